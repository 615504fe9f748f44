/* SPDX-License-Identifier: MIT
 *
 * Poses primitives at a time t, with cubic motion, linear rotation and temporal
 * opacity. All functions work on a range of primitives on one thread; other
 * threads may do other ranges.
 */
#ifndef SAGA_SPLAT_ANIMATE_H
#define SAGA_SPLAT_ANIMATE_H

#include "isa.h"
#include "splat.h"

#define saga_splat_place SAGA_ISA_NAME(saga_splat_place)
#define saga_splat_animate_forward SAGA_ISA_NAME(saga_splat_animate_forward)
#define saga_splat_animate_backward SAGA_ISA_NAME(saga_splat_animate_backward)

/* Sets rows `of` of mean (N, 3) to the means at time t. */
extern void saga_splat_place(real *mean, const saga_splat_params *p,
                             saga_range of, real t);

/* With dt = t - t_centre and age = dt ageing (splat_age.h), clamped to +-4, it
 * sets
 *
 *     mean   mean + support (((b3 age + b2) age + b1) age)
 *     quat   quat + slope age
 *     q0     log2(1 + 2^(3 - o)) - 3 + log2(e) u^2,
 *            u = min(16, |dt| 2^-log2_width) */
extern void saga_splat_animate_forward(saga_splat_posed *out,
                                       const saga_splat_params *p,
                                       saga_range of, real t);

/* Adds to d from canvas->splat.d_posed. Primitives that are not visible have no
 * gradient and are skipped. */
extern void saga_splat_animate_backward(saga_splat_params *d,
                                        const saga_canvas *canvas,
                                        const saga_splat_params *p,
                                        saga_range of);

#endif
