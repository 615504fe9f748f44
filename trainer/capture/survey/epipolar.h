/* SPDX-License-Identifier: MIT
 *
 * A place that one camera sees at a pixel is, in another camera's picture, on a
 * line: the epipolar line of the pixel (Hartley and Zisserman, chapter 9). The
 * distance of a match from this line tells whether poses and lenses are right.
 */
#ifndef SAGA_EPIPOLAR_H
#define SAGA_EPIPOLAR_H

#include "capture.h"
#include "matches.h"

typedef struct saga_pinhole {
    double rotation[9], translation[3]; /* world to camera */
    double lens[4];                     /* fx, fy, cx, cy, in pixels */
} saga_pinhole;

saga_pinhole saga_pinhole_of(const saga_source_view *view);

/* The pose of camera b relative to camera a: X_b = R X_a + t. */
typedef struct saga_epipolar {
    double r[9], t[3];
} saga_epipolar;

saga_epipolar saga_epipolar_between(const saga_pinhole *a,
                                    const saga_pinhole *b);

/* Returns the distance in pixels of a match's points from each other's epipolar
 * lines, the larger of the two. Sets *front to whether the rays meet in front
 * of both cameras or are parallel within `within` pixels. */
double saga_epipolar_off(const saga_pinhole *a, const saga_pinhole *b,
                         const saga_epipolar *between, const saga_match *match,
                         double within, bool *front);

/* Returns the distance in pixels of a match's point in b from where b would see
 * the other point if that were far away, or if both cameras stood at one place;
 * infinity if it would be behind b. */
double saga_epipolar_turned(const saga_pinhole *a, const saga_pinhole *b,
                            const saga_match *match);

#endif
