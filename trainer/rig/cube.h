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

/* Finds the cube that contains the scene, or the subject if the capture has
 * one. Sets range (n_views, 2) to each view's nearest and farthest depth, in
 * world units. Returns false with *error set if memory is short, or if the
 * masks of a subject contradict each other. */
bool saga_cube_fit(saga_cube *cube, double *range, const saga_capture *capture,
                   saga_error *error);

/* Finds the box of the capture's subject, as saga_capture.box. The segments of
 * a film need one box that contains those of all. Fails as saga_cube_fit. */
bool saga_cube_subject(double box[6], const saga_capture *capture,
                       saga_error *error);

#endif
