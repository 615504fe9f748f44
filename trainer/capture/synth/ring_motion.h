/* SPDX-License-Identifier: MIT
 *
 * Says what a seed draws for the scene "ring", and where everything is.
 */
#ifndef SAGA_RING_MOTION_H
#define SAGA_RING_MOTION_H

#include "synth_ring.h"

/* Returns a number of lo..hi, the index-th that a seed draws. */
double saga_ring_draw(uint32_t seed, int index, double lo, double hi);

void saga_ring_draw_plan(saga_ring_plan *plan, uint32_t seed);

/* Appends the runner's shapes to `to`, which has room for
 * SAGA_RING_BODY_SHAPES; hand is where a ball in the right one lies. */
enum { SAGA_RING_BODY_SHAPES = 22 };
int saga_ring_body(saga_ring_shape *to, double hand[3],
                   const saga_ring_plan *plan, double seconds);

/* Makes a capsule from a to b, whose second own axis is `side` as far as it can
 * be; and a ball whose own axes are the rows of `frame`. */
saga_ring_shape saga_ring_capsule(const double a[3], const double b[3],
                                  double radius, const double side[3],
                                  enum saga_ring_object object);
saga_ring_shape saga_ring_ball(const double centre[3], double radius,
                               double frame[3][3],
                               enum saga_ring_object object);

#endif
