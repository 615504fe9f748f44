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

/* Returns the class of a block, which is that of a coarse anchor; other kinds
 * have no features. */
static inline saga_class saga_rate_class(const saga_scene *s, int kind,
                                         size_t block)
{
    return kind == SAGA_KIND_COARSE ? saga_scene_class(s, block)
                                    : (saga_class){ 0, 0, 0 };
}

/* Tells whether channel c of a block of a class is coded. The first four always
 * are, and then come the features. */
static inline bool saga_rate_has(saga_class class, size_t c)
{
    return c < 4 || saga_class_has(class, (uint32_t)c - 4);
}

/* Keeps a block's mu, rounded to the values' format as in the coder. Values are
 * later rounded against it. */
void saga_rate_remember_mu(saga_rate *r, const saga_model *m, int kind,
                           size_t block, const real *mu);

#endif
