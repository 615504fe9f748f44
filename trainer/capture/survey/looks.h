/* SPDX-License-Identifier: MIT
 *
 * What the pictures of a camera look like, without any pose: whether they show
 * anything, are noise, are out of focus, or stand still while others change.
 */
#ifndef SAGA_LOOKS_H
#define SAGA_LOOKS_H

#include "capture.h"

typedef struct saga_look {
    double level;        /* median of green of the darkest blank picture,
                          * or of the last one looked at, 0 to 255 */
    int n_seen, n_blank; /* number of pictures looked at, and of those
                          * without contrast */
    double alike;        /* correlation of pixels side by side; NaN: there
                          * is no contrast */
    double detail;       /* second differences of pixels side by side, as a
                          * part of those over four pixels: 0.5 at a sharp
                          * edge, 1 of noise, and 0.1 once blurred by two
                          * pixels; NaN: there is no contrast */
    double still;        /* part of the steps between pictures in which this
                          * camera does not change while most others do;
                          * NaN: there are too few */
} saga_look;

/* Sets looks (n_views). Pictures that are missing, and pixels that masks
 * exclude, do not count. */
bool saga_looks_find(saga_look *looks, const saga_capture *capture,
                     saga_error *error);

#endif
