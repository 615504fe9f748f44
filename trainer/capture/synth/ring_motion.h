/* SPDX-License-Identifier: MIT
 *
 * Draws the random parameters of the scene "ring" from a seed, and computes the
 * positions of all objects at a time.
 */
#ifndef SAGA_RING_MOTION_H
#define SAGA_RING_MOTION_H

#include "synth_ring.h"

/* Returns random number `index` of a seed, in lo..hi. */
double saga_ring_draw(uint32_t seed, int index, double lo, double hi);

void saga_ring_draw_plan(saga_ring_plan *plan, uint32_t seed);

/* Appends the runner's shapes to `to`, which has room for
 * SAGA_RING_BODY_SHAPES, and sets `hand` to the place of a ball in the right
 * hand. */
enum { SAGA_RING_BODY_SHAPES = 22 };
int saga_ring_body(saga_ring_shape *to, double hand[3],
                   const saga_ring_plan *plan, double seconds);

/* saga_ring_capsule makes a capsule from a to b, whose own second axis is as
 * near to `side` as possible; saga_ring_ball makes a ball whose own axes are
 * the rows of `frame`. */
saga_ring_shape saga_ring_capsule(const double a[3], const double b[3],
                                  double radius, const double side[3],
                                  enum saga_ring_object object);
saga_ring_shape saga_ring_ball(const double centre[3], double radius,
                               double frame[3][3],
                               enum saga_ring_object object);

#endif
