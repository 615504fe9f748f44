/* SPDX-License-Identifier: MIT
 *
 * The cost of rate_bits.h for a row of values at once, since an iteration, and
 * measuring constants, evaluate some hundred thousand. In float the tail of the
 * normal distribution is approximated by
 *
 *     P(X > x) = e^(-x^2 / 2) t p(t), t = 1 / (1 + 0.285 x), x >= 0,
 *
 * with a fitted polynomial p of degree 8. The relative error is 1.6e-7, or 5e-7
 * when computed in floats. If sigma is many steps, the probability is a small
 * difference of two such tails, and the bits are off by up to 1e-4. In double
 * the cost is that of saga_rate_bits.
 */
#ifndef SAGA_RATE_ROW_H
#define SAGA_RATE_ROW_H

#include "isa.h"
#include "model.h"
#include "real.h"

#include <stddef.h>

/* The largest number of values in a block, which is an anchor or all its
 * primitives, rounded up to whole vectors. */
enum { SAGA_RATE_ROW = (4 + SAGA_MAX_FEATURES + 7) / 8 * 8 };
_Static_assert(SAGA_RATE_ROW >= 4 * SAGA_MAX_CHILDREN, "room for primitives");

/* Inputs and results of saga_rate_bits, for each value. */
typedef struct saga_rate_row {
    real v[SAGA_RATE_ROW], log2_sigma[SAGA_RATE_ROW];
    real bits[SAGA_RATE_ROW], d_v[SAGA_RATE_ROW], d_log2_sigma[SAGA_RATE_ROW];
} saga_rate_row;

#define saga_rate_cost_row SAGA_ISA_NAME(saga_rate_cost_row)

/* Sets bits and derivatives of the first n values. */
extern void saga_rate_cost_row(saga_rate_row *r, size_t n);

#endif
