/* SPDX-License-Identifier: MIT
 *
 * Poses primitives at a time t, with cubic motion, linear rotation and temporal
 * opacity.
 */
#ifndef SAGA_SPLAT_ANIMATE_H
#define SAGA_SPLAT_ANIMATE_H

#include "splat.h"

#define saga_splat_ageing SAGA_REAL_NAME(saga_splat_ageing)
#define saga_splat_place SAGA_REAL_NAME(saga_splat_place)
#define saga_splat_animate_forward SAGA_REAL_NAME(saga_splat_animate_forward)
#define saga_splat_animate_backward SAGA_REAL_NAME(saga_splat_animate_backward)

/* Returns by how much the age of primitive i grows in a unit of time:
 * 1 / min(width, 1/2), at most 2^100, so that a dt of 0 gives age 0. */
real saga_splat_ageing(const saga_splat_params *p, size_t i);

/* Sets x to the mean of primitive i at time t. */
void saga_splat_place(real x[3], const saga_splat_params *p, size_t i, real t);

/* Poses a range of primitives on one thread; other threads may do other ranges.
 * With dt = t - t_centre and age = dt ageing, clamped to +-4, it sets
 *
 *     mean   mean + support (((b3 age + b2) age + b1) age)
 *     quat   quat + slope age
 *     q0     log2(1 + 2^(3 - o)) - 3 + log2(e) u^2,
 *            u = min(16, |dt| 2^-log2_width) */
void saga_splat_animate_forward(saga_splat_posed *out,
                                const saga_splat_params *p, saga_range of,
                                real t);

/* Adds to d from canvas->splat.d_posed. Primitives that are not visible have no
 * gradient and are skipped. */
void saga_splat_animate_backward(saga_splat_params *d,
                                 const saga_canvas *canvas,
                                 const saga_splat_params *p, saga_range of);

#endif
