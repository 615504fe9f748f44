/* SPDX-License-Identifier: MIT
 *
 * Primitives at a time t: cubic motion, linear rotation, temporal opacity
 * (paper: theta_geo evaluated at a timestamp, after STG).
 */
#ifndef SAGA_ANIMATE_H
#define SAGA_ANIMATE_H

#include "primitive.h"

/* Constants of animate.c and of its SIMD version. */
#define LIMIT_X (1 << 29)               /* positions saturate here */
#define LIMIT_U (16 << 16)              /* u of the temporal opacity, Q16 */
#define LIMIT_AGE (4 << 16)             /* Q16 */
#define LIMIT_MOTION ((int64_t)1 << 39) /* Q20, supports */
#define HALF_SEGMENT (15 << 10)         /* log2 of it in units of time, Q10 */
#define LOG2_E_Q20 1512775              /* log2(e) */

/* Computes primitive p at time t, 0..65535, where dt = t - t_centre, |dt| <
 * 2^17, and age = dt / min(width, 1/2 segment), in -4..4:
 * x(t) = x + support * (((b3 age + b2) age + b1) age),
 * quat(t) = quat + slope age, q0 = softplus2(3 - o) + log2(e) (dt / width)^2.
 * Writes every field of out. */
void saga_animate(saga_animated *out, const saga_primitive *p,
                  const saga_prim_format *f, int32_t t);

/* Does as saga_animate and returns 1 if the primitive is visible (q0 < 11);
 * otherwise returns 0, and *out is undefined. */
int saga_animate_visible(saga_animated *out, const saga_primitive *p,
                         const saga_prim_format *f, int32_t t);

/* Computes x only. */
void saga_animate_mean(int32_t x[3], const saga_primitive *p,
                       const saga_prim_format *f, int32_t t);

#endif
