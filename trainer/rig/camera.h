/* SPDX-License-Identifier: MIT
 *
 * Converts cameras of a capture to the integers of the decoder, and back.
 *
 * metres = centre + box units * unit (saga_info).
 */
#ifndef SAGA_CAMERA_H
#define SAGA_CAMERA_H

#include "capture.h"
#include "saga.h"

typedef struct saga_metric {
    double unit, centre[3]; /* in metres */
} saga_metric;

static inline double saga_metric_width(const saga_metric *m)
{
    return m->unit * 16777216.0; /* a side has 2^24 units */
}

saga_metric saga_metric_of(const saga_info *info);

/* Sets the members of a decoder's camera from a capture's, except the
 * background. Encoder and evaluation must both use this function, since pixels
 * depend on every bit:
 *   rotation   each row divided by its length, times 2^30, to nearest (halves
 *              to even): sum |r| <= sqrt(3) 2^30 + 1.5 < 1.7321 * 2^30
 *   centre     -R^T t, minus the metric's centre, over the unit, to nearest
 *   focal      and principal point times 2^16, to nearest
 *   near       near_metres over the unit, to nearest, at least 1
 * Returns false with *error set if a value exceeds the range given in
 * saga.h. */
bool saga_camera_of_source_view(saga_camera *camera, const saga_metric *metric,
                                const saga_source_view *view,
                                double near_metres, saga_error *error);

/* Does the reverse, up to rounding. Other members, such as name and near_depth,
 * are left unchanged. */
void saga_source_view_of_camera(saga_source_view *view,
                                const saga_metric *metric,
                                const saga_camera *camera);

/* Sets centre to the position of a view's camera, in metres. */
void saga_source_view_centre(double centre[3], const saga_source_view *view);

#endif
