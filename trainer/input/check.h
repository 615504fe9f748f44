/* SPDX-License-Identifier: MIT
 *
 * Do the cameras and the points of a capture fit together? Reprojects the
 * points into each view; finds out whether views overlap at all, and whether
 * a failure looks like poses in another axis convention.
 */
#ifndef SAGA_CHECK_H
#define SAGA_CHECK_H

#include "capture.h"

#include <stddef.h>

typedef struct saga_check_view {
    size_t n_points;
    double in_front;         /* share of all points with z > 0 */
    double inside;           /* share in front and inside the picture */
    double inside_flipped;   /* the same, had y and z of the camera the other
                              * sign: OpenGL poses read as OpenCV, or back */
    double nearest, farthest; /* depth of the points inside; 0, 0 if none */
} saga_check_view;

/* View within the capture's count; all zero without points. */
saga_check_view saga_check_points(const saga_capture *capture, int view);

/* False with an error if no two views see anything in common, by the points
 * or, with fewer than 8 of them, by the frusta. Views that see hardly any
 * point are named in the notes. */
bool saga_check_overlap(saga_capture *capture, const char *path,
                        saga_error *error);

#endif
