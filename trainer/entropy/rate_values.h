/* SPDX-License-Identifier: MIT
 *
 * Values that are coded, as rate_*.c share them.
 */
#ifndef SAGA_RATE_VALUES_H
#define SAGA_RATE_VALUES_H

#include "rate_loss.h"
#include "rate_row.h"

#define saga_rate_step_size SAGA_REAL_NAME(saga_rate_step_size)
#define saga_rate_read_block SAGA_REAL_NAME(saga_rate_read_block)
#define saga_rate_remember_mu SAGA_REAL_NAME(saga_rate_remember_mu)

/* Returns the step of a kind's channel c, in reals of the value. */
double saga_rate_step_size(const saga_model *m, int kind, size_t c);

/* Finds the values of a block: rows of all its channels. Returns the number of
 * rows: one, or that of its primitives. */
size_t saga_rate_read_block(double y[SAGA_RATE_ROW], const saga_rate *r,
                            const saga_rate_input *x, int kind, size_t block);

/* Keeps a block's mu, in whole steps of the values' format as the coder has it,
 * for values to be rounded against. */
void saga_rate_remember_mu(saga_rate *r, const saga_model *m, int kind,
                           size_t block, const real *mu);

#endif
