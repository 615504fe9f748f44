/* SPDX-License-Identifier: MIT
 *
 * A built-in scene becomes a capture in stages, a file each: where the cameras
 * stand (synth_camera), the folder and what lies where in it (synth_folder),
 * the pictures (synth_picture), the points (synth_points), transforms.json
 * (synth_json); synth goes through them.
 */
#ifndef SAGA_SYNTH_JOB_H
#define SAGA_SYNTH_JOB_H

#include "synth.h"

typedef struct saga_synth_job {
    const saga_synth_options *options;
    char *folder;             /* being filled */
    int lock;                 /* on it */
    saga_shot *views;         /* (n_cameras) */
    saga_error *error;
    const char *target;       /* final name, for messages */
    int first_failed, n_done; /* guarded by "omp critical(saga_synth)" */
} saga_synth_job;

enum { SAGA_SYNTH_PATH = 1200 };

/* Computes the direction through a pixel position, with z = 1 in the camera's
 * axes, so that the distance along it is the depth. */
void saga_synth_direction(const saga_shot *view, double u, double v,
                          double d[3]);

/* Refuses a folder of files at the start, not after the rendering. */
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

/* Turns light to 8 bits: gamma 2, exact on every machine. */
uint8_t saga_synth_display(double light);
bool saga_synth_write_pictures(saga_synth_job *job);
bool saga_synth_write_points(const saga_synth_job *job);
bool saga_synth_write_json(const saga_synth_job *job);

#endif
