/* SPDX-License-Identifier: MIT
 *
 * The cost of rate_bits.h, of a row of values at once: training evaluates some
 * hundred thousand in an iteration. In float the normal distribution's tails
 * are
 *
 *     P(X > x) = e^(-x^2 / 2) t p(t), t = 1 / (1 + 0.285 x), x >= 0,
 *
 * p of degree 8, fitted: 1.6e-7 of it, 5e-7 as floats calculate it. Where a
 * deviation is many steps a value's probability is a small difference of two
 * such tails, so that its bits are off by up to 1e-4. In double the costs are
 * those of saga_rate_bits.
 */
#ifndef SAGA_RATE_ROW_H
#define SAGA_RATE_ROW_H

#include "real.h"
#include "model.h"

#include <stddef.h>

/* The most values of a block, an anchor's or all its primitives', rounded up to
 * whole vectors. */
enum { SAGA_RATE_ROW = (4 + SAGA_MAX_FEATURES + 7) / 8 * 8 };
_Static_assert(SAGA_RATE_ROW >= 4 * SAGA_MAX_CHILDREN, "room for primitives");

/* As saga_rate_bits takes and gives them. */
typedef struct saga_rate_row {
    real v[SAGA_RATE_ROW], log2_sigma[SAGA_RATE_ROW];
    real bits[SAGA_RATE_ROW], d_v[SAGA_RATE_ROW], d_log2_sigma[SAGA_RATE_ROW];
} saga_rate_row;

#define saga_rate_cost_row SAGA_REAL_NAME(saga_rate_cost_row)

/* Sets bits and derivatives of the first n values. */
void saga_rate_cost_row(saga_rate_row *r, size_t n);

#endif
