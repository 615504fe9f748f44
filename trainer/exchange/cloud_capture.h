/* SPDX-License-Identifier: MIT
 *
 * Turns splats that another program trained into the input of training: a
 * capture whose pictures are drawn from the splats, and for a still also the
 * primitives that training starts with.
 */
#ifndef SAGA_CLOUD_CAPTURE_H
#define SAGA_CLOUD_CAPTURE_H

#include "capture.h"
#include "cloud.h"
#include "splat.h"

/* The splats, and the cameras for which they are drawn. */
typedef struct saga_cloud_source {
    char **path; /* (n_frames); one if the splats move */
    bool moves;
    const saga_cloud *first; /* the splats of frame 0, read before */
    uint64_t most_nbytes;    /* memory for pictures, and for reading a file */
    saga_cloud_facts *facts; /* what reading the other frames tells is added */
    int n_frames;
    double fps;
    const saga_source_view *view; /* (n_views) name, size, lens, place */
    int n_views;
    saga_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_cloud_source;

/* Reads the frames one after another and draws every frame for every view, on a
 * black background. A part of the splats' means become the points of the
 * capture. The caller frees it with saga_capture_free. */
bool saga_cloud_capture(saga_capture *capture, const saga_cloud_source *source,
                        saga_error *error);

/* Makes primitives from a cloud; saga_params_free frees them. A primitive's
 * colour is the mean of its splat's colours as seen from the n_views cameras,
 * clipped to 0..1. */
bool saga_cloud_params(saga_splat_params *p, const saga_cloud *cloud,
                       const saga_source_view *view, int n_views,
                       saga_error *error);

/* Finds the centre and the radius of a cloud such that a few distant splats
 * have no influence. Splats are weighted by opacity: the centre is the median
 * on each axis, and the sphere of that radius holds four fifths of the
 * weight. */
bool saga_cloud_extent(double centre[3], double *radius,
                       const saga_cloud *cloud, saga_error *error);

#endif
