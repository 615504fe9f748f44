/* SPDX-License-Identifier: MIT
 *
 * A cube maps positions in half-cubes, [-1, 1)^3, to the capture's world.
 */
#ifndef SAGA_CUBE_H
#define SAGA_CUBE_H

#include "capture.h"

/* world = centre + unit * (position in half-cubes) */
typedef struct saga_cube {
    double centre[3];
    double unit; /* world lengths per half-cube, > 0 */
} saga_cube;

/* Finds the cube that contains the scene. Sets range (n_views, 2) to each
 * view's nearest and farthest depth, in world units. Returns false with *error
 * set if memory is short. */
bool saga_cube_fit(saga_cube *cube, double *range, const saga_capture *capture,
                   saga_error *error);

#endif
