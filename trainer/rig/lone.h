/* SPDX-License-Identifier: MIT
 *
 * A lone view has no other training view near it. Nobody checks what a viewer
 * sees beside it, so training keeps primitives from being as long as they are
 * far from it: the projection of such a primitive is right where cameras film,
 * and anything between them (docs/lab/warm-up.md).
 */
#ifndef SAGA_LONE_H
#define SAGA_LONE_H

#include "pictures.h"

/* A view whose nearest neighbour is farther than this is alone: 10 degrees, in
 * radians. */
#define SAGA_LONE_ANGLE 0.1745

/* Returns the angle between two views as seen from the middle of the scene, or
 * infinity if they look in different directions. */
double saga_view_angle(const saga_pictures *pictures, int v, int w);

/* The places of the lone views among the training views. */
typedef struct saga_lone {
    real *centre; /* (n, 3) half-cubes */
    int n;
} saga_lone;

/* Finds the lone views. There are none if one camera moves, or around a
 * subject. Returns false with *error set, and nothing to free, if memory is
 * short. */
bool saga_lone_find(saga_lone *lone, const saga_pictures *pictures,
                    saga_error *error);
void saga_lone_free(saga_lone *lone);

/* Returns the distance of a place from the nearest lone view, or infinity if
 * there is none. */
real saga_lone_distance(const saga_lone *lone, const real *place);

#endif
