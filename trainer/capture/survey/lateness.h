/* SPDX-License-Identifier: MIT
 *
 * Finds by how many frames cameras run behind the others, from the amount of
 * change between consecutive pictures, and how certain this is. The visible
 * motion differs between cameras, so that most of the work is to recognise when
 * nothing can be concluded.
 */
#ifndef SAGA_LATENESS_H
#define SAGA_LATENESS_H

#include "capture.h"

typedef struct saga_lateness {
    double frames;    /* delay behind the others, < 0: ahead; NaN:
                       * unknown */
    double tolerance; /* 0.1 frames plus 2.4 standard errors of the
                       * delay; NaN: unknown */
} saga_lateness;

/* Sets late (n_views). It is NaN for fewer than three views, for fewer than
 * twelve frames, and for a camera that moves. */
bool saga_lateness_find(saga_lateness *late, const saga_capture *capture,
                        saga_error *error);

/* Returns the delay to correct for: the nearest whole number of frames if that
 * is within the tolerance, because cameras usually lose whole frames. */
double saga_lateness_likely(const saga_lateness *late);

/* Returns the sum of absolute differences between frames k and k + 1 of a view,
 * in green, at every `pixels`-th pixel. */
double saga_change_at(const saga_capture *capture, int view, int k,
                      size_t pixels);

/* Returns the variance of a mean by the jackknife: x has n results, each
 * without one of n groups. */
double saga_jackknife(const double *x, int n);

#endif
