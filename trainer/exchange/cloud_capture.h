/* SPDX-License-Identifier: MIT
 *
 * Splats that somebody else trained come in as what training takes: a capture
 * whose pictures are drawn from them, and for a still the primitives to start
 * with.
 */
#ifndef SAGA_CLOUD_CAPTURE_H
#define SAGA_CLOUD_CAPTURE_H

#include "capture.h"
#include "cloud.h"
#include "splat.h"

/* Files of splats, a frame each, and the cameras they are drawn for. */
typedef struct saga_cloud_source {
    char **path;             /* (n_frames) */
    int n_frames;
    double fps;
    const saga_shot *shot;   /* (n_shots) name, size, lens, place */
    int n_shots;
    saga_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_cloud_source;

/* Reads the files one after another and draws every shot of each, black behind
 * the splats. The splats' means, some of them, become the capture's points.
 * Frees with saga_capture_free. */
bool saga_cloud_capture(saga_capture *capture, const saga_cloud_source *source,
                        saga_error *error);

/* Makes primitives of a cloud (saga_params_free them): colours are the means of
 * those that n_shots see, clipped to 0..1. */
bool saga_cloud_params(saga_splat_params *p, const saga_cloud *cloud,
                       const saga_shot *shot, int n_shots, saga_error *error);

/* A place and a size of a cloud that its far-off splats do not count in:
 * weighted by opacity, the median on each axis, and the distance from there
 * that holds four fifths. */
bool saga_cloud_extent(double centre[3], double *radius,
                       const saga_cloud *cloud, saga_error *error);

#endif
