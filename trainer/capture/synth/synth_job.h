/* SPDX-License-Identifier: MIT
 *
 * A built-in scene becomes a capture in stages, one file each: the positions of
 * the cameras (synth_camera), the folder (synth_folder), the pictures
 * (synth_picture), the points (synth_points), and transforms.json (synth_json).
 * synth.c calls them.
 */
#ifndef SAGA_SYNTH_JOB_H
#define SAGA_SYNTH_JOB_H

#include "synth.h"

typedef struct saga_synth_job {
    const saga_synth_options *options;
    char *folder;            /* the folder that is being filled */
    int lock;                /* file descriptor of the folder's lock */
    saga_source_view *views; /* (n_cameras) */
    saga_error *error;
    const char *target;       /* final name, for messages */
    int first_failed, n_done; /* guarded by "omp critical(saga_synth)" */
} saga_synth_job;

enum { SAGA_SYNTH_PATH = 1200 };

/* Computes the direction through a pixel position, with z = 1 in the camera's
 * axes, so that the distance along it is the depth. */
void saga_synth_direction(const saga_source_view *view, double u, double v,
                          double d[3]);

/* Tells whether the folder may be written, at the start and not after the
 * rendering. Sets the error if it has files. */
bool saga_synth_is_free(const saga_synth_job *job);
/* Makes the folder beside its final place, so that rename can move it in one
 * step. */
bool saga_synth_begin_folder(saga_synth_job *job);
bool saga_synth_make_folders(const saga_synth_job *job);
/* Removes the folders that this run has made, and the plain files in them. */
void saga_synth_remove(const saga_synth_job *job);
/* Writes the path of a picture of a kind, "images" or "depth", into path. */
void saga_synth_path(const saga_synth_job *job, const char *kind,
                     const char *ending, int camera, int frame,
                     char path[SAGA_SYNTH_PATH]);
bool saga_synth_has_depth(const saga_synth_options *o, int frame);

/* Converts light to 8 bits with gamma 2, which is exact on every machine. */
uint8_t saga_synth_display(double light);
bool saga_synth_write_pictures(saga_synth_job *job);
bool saga_synth_write_points(const saga_synth_job *job);
bool saga_synth_write_json(const saga_synth_job *job);

#endif
