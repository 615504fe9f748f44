/* SPDX-License-Identifier: MIT
 *
 * Finds by how many frames a camera of a capture runs behind the others, by
 * how much changes from picture to picture, and how sure that is. What is seen
 * to move differs from side to side, so most of the work is to know when
 * nothing can be told.
 */
#ifndef SAGA_LATENESS_H
#define SAGA_LATENESS_H

#include "capture.h"

typedef struct saga_lateness {
    double frames;           /* behind the others, below 0: before them; NaN:
                              * cannot be told */
    double tolerance;        /* of that, frames: 2.4 standard errors and 0.1;
                              * NaN likewise */
} saga_lateness;

/* Sets late (n_views). Nothing can be told of fewer than three views or twelve
 * frames, nor of a camera that moves. */
bool saga_lateness_find(saga_lateness *late, const saga_capture *capture,
                        saga_error *error);

/* Returns the sum of absolute differences between frames k and k + 1 of a view,
 * in green, at every `pixels`-th pixel. */
double saga_change_at(const saga_capture *capture, int view, int k,
                      size_t pixels);

/* Returns the variance of a mean, estimated from n results, each without one of
 * n groups. */
double saga_jackknife(const double *x, int n);

#endif
