/* SPDX-License-Identifier: MIT
 *
 * A cube maps [-1, 1)^3, in half-cubes, to the capture's world.
 */
#ifndef SAGA_CUBE_H
#define SAGA_CUBE_H

#include "capture.h"

/* world = centre + unit * (position in half-cubes) */
typedef struct saga_cube {
    double centre[3];
    double unit;               /* of the world's length per half-cube, > 0 */
} saga_cube;

/* Finds the cube. range (n_views, 2) receives each view's nearest and farthest
 * depth, world units. Fails where memory is short. */
bool saga_cube_fit(saga_cube *cube, double *range,
                   const saga_capture *capture, saga_error *error);

#endif
