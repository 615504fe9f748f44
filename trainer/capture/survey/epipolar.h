/* SPDX-License-Identifier: MIT
 *
 * A place that one camera sees lies, for another camera, on a line: the
 * epipolar line of its pixel (Hartley and Zisserman, chapter 9). How far a
 * match is from it tells whether poses and lenses are right.
 */
#ifndef SAGA_EPIPOLAR_H
#define SAGA_EPIPOLAR_H

#include "capture.h"
#include "matches.h"

typedef struct saga_pinhole {
    double rotation[9], translation[3]; /* world to camera */
    double lens[4];          /* fx, fy, cx, cy, pixels */
} saga_pinhole;

saga_pinhole saga_pinhole_of(const saga_shot *shot);

/* Where camera b stands from camera a: X_b = R X_a + t. */
typedef struct saga_epipolar { double r[9], t[3]; } saga_epipolar;

saga_epipolar saga_epipolar_between(const saga_pinhole *a,
                                    const saga_pinhole *b);

/* Returns how many pixels a match is off the lines on which its points should
 * lie, the larger of the two; *front is whether the rays meet before both
 * cameras, or are parallel but for `within` pixels. */
double saga_epipolar_off(const saga_pinhole *a, const saga_pinhole *b,
                         const saga_epipolar *between, const saga_match *match,
                         double within, bool *front);

#endif
