/* SPDX-License-Identifier: MIT
 *
 * Primitives at a time t: cubic motion, linear rotation, temporal opacity
 * (paper: theta_geo evaluated at a timestamp, after STG).
 */
#ifndef SAGA_ANIMATE_H
#define SAGA_ANIMATE_H

#include "primitive.h"

/* dt = t - t_centre, |dt| < 2^17; age = dt / min(width, 1/2 segment), in -4..4.
 * x(t) = x + support * (((b3 age + b2) age + b1) age),
 * quat(t) = quat + slope age, q0 = softplus2(-o) + log2(e) (dt / width)^2.
 * t in 0..65535. Every field of out is always written. */
void saga_animate(saga_animated *out, const saga_primitive *p,
                  const saga_prim_format *f, int32_t t);

/* x alone. */
void saga_animate_mean(int32_t x[3], const saga_primitive *p,
                       const saga_prim_format *f, int32_t t);

#endif
