/* SPDX-License-Identifier: MIT
 *
 * The coded values, shared by rate_*.c.
 */
#ifndef SAGA_RATE_VALUES_H
#define SAGA_RATE_VALUES_H

#include "rate_loss.h"
#include "rate_row.h"

#define saga_rate_step_size SAGA_REAL_NAME(saga_rate_step_size)
#define saga_rate_read_block SAGA_REAL_NAME(saga_rate_read_block)
#define saga_rate_remember_mu SAGA_REAL_NAME(saga_rate_remember_mu)

/* Returns the step of channel c of a kind, in the value's unit. */
double saga_rate_step_size(const saga_model *m, int kind, size_t c);

/* Sets y to the values of a block, one row with all its channels, or a row for
 * each of its primitives. Returns the number of rows. */
size_t saga_rate_read_block(double y[SAGA_RATE_ROW], const saga_rate *r,
                            const saga_rate_input *x, int kind, size_t block);

/* Keeps a block's mu, rounded to the values' format as in the coder. Values are
 * later rounded against it. */
void saga_rate_remember_mu(saga_rate *r, const saga_model *m, int kind,
                           size_t block, const real *mu);

#endif
