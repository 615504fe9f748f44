/* SPDX-License-Identifier: MIT
 *
 * A capture is loaded in stages, one file each: capture_load.c checks the
 * options and makes the views, load_budget.c forecasts their memory,
 * load_pictures.c decodes the pictures.
 */
#ifndef SAGA_LOAD_JOB_H
#define SAGA_LOAD_JOB_H

#include "load.h"

typedef struct saga_load_job {
    const saga_capture_options *options;
    const saga_listing *listing;
    saga_capture *capture;
    saga_remap *remaps; /* (n_views): planned, but without tables */
    size_t n_taken;     /* bytes of capture->pixels that views have taken */
    int n_threads;
    saga_error *error;
    /* Guarded by "omp critical(saga_load)". */
    int first_failed; /* lowest item that failed; INT32_MAX: none; -1:
                       * cancelled */
    int n_done, n_pictures;
} saga_load_job;

/* Returns whether the opacity of a source's pictures is to be their mask. */
bool saga_load_has_opacity(const saga_load_job *job, const saga_source *s);
/* Returns whether the pictures of a source have masks. */
bool saga_load_has_masks(const saga_load_job *job, const saga_source *s);
/* Returns whether a source has at most one picture although several frames are
 * wanted. */
bool saga_load_is_single(const saga_load_job *job, const saga_source *s);

/* Fails if loading needs more memory than the options allow; the error says
 * what would fit. */
bool saga_load_check_budget(const saga_load_job *job);
/* Returns the bytes of all pictures and masks. */
uint64_t saga_load_picture_nbytes(const saga_load_job *job);
/* Returns whether they are kept in a file. */
bool saga_load_uses_scratch(const saga_load_job *job);

/* Fills the views, which have been made, with pictures, masks and depth;
 * missing pictures and masked pixels are copied from near frames. */
bool saga_load_pictures(saga_load_job *job);

#endif
