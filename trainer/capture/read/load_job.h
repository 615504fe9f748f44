/* SPDX-License-Identifier: MIT
 *
 * A capture is loaded in stages, a file each: capture_load checks what is
 * wanted and makes the views, load_budget forecasts their memory,
 * load_pictures decodes into them.
 */
#ifndef SAGA_LOAD_JOB_H
#define SAGA_LOAD_JOB_H

#include "load.h"

typedef struct saga_load_job {
    const saga_capture_options *options;
    const saga_listing *listing;
    saga_capture *capture;
    saga_remap *remaps;       /* (n_views), planned, without tables */
    int n_threads;
    saga_error *error;
    /* Guarded by "omp critical(saga_load)". */
    int first_failed;         /* lowest item that failed; INT32_MAX none,
                               * -1 cancelled */
    int n_done, n_items;
} saga_load_job;

/* Tells whether the pictures of a source have masks. */
bool saga_load_has_masks(const saga_load_job *job, const saga_source *s);
/* Tells whether a source has at most one of several pictures wanted. */
bool saga_load_is_single(const saga_load_job *job, const saga_source *s);

/* Refuses what needs more memory than the options allow, and says what would
 * fit. */
bool saga_load_check_budget(const saga_load_job *job);
/* Returns how many frames' pictures take half the budget: what a thread needs
 * besides does not count, so that it is the same for any number of them. */
int saga_load_frames_that_fit(const saga_load_job *job);

/* Fills the views of the capture, which are made, with pictures, masks and
 * depth; what is missing or masked looks as near frames do. */
bool saga_load_pictures(saga_load_job *job);

#endif
