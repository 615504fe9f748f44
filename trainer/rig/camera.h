/* SPDX-License-Identifier: MIT
 *
 * Makes a camera of a capture as the decoder wants it, in integers.
 *
 * Metres and box units: metres = centre + box units * unit (saga_info).
 */
#ifndef SAGA_CAMERA_H
#define SAGA_CAMERA_H

#include "capture.h"
#include "saga.h"

typedef struct saga_metric {
    double unit, centre[3];  /* metres */
} saga_metric;

static inline double saga_metric_width(const saga_metric *m)
{
    return m->unit * 16777216.0; /* 2^24 units a side */
}

saga_metric saga_metric_of(const saga_info *info);

/* Sets a camera of a capture in integers. Encoder and evaluation must both come
 * through here, since pixels depend on every bit:
 *   rotation   each row divided by its length, times 2^30, to nearest (halves
 *              to even): sum |r| <= sqrt(3) 2^30 + 1.5 < 1.7321 * 2^30
 *   centre     -R^T t, minus the metric's centre, over the unit, to nearest
 *   focal      and principal point times 2^16, to nearest
 *   near       near_metres over the unit, to nearest, at least 1
 * The background is left as it was. False: a value leaves the range that
 * saga.h states for it. */
bool saga_camera_of_shot(saga_camera *camera, const saga_metric *metric,
                         const saga_shot *shot, double near_metres,
                         saga_error *error);

/* Goes the way back, up to the rounding: name, near_depth and the like are not
 * touched. */
void saga_shot_of_camera(saga_shot *shot, const saga_metric *metric,
                         const saga_camera *camera);

/* Finds where a shot's camera stands, metres. */
void saga_shot_centre(double centre[3], const saga_shot *shot);

#endif
