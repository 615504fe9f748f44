/* SPDX-License-Identifier: MIT
 *
 * A coder that returns any symbols, for proofs of what is made of them.
 */
#ifndef ANY_CODER_H
#define ANY_CODER_H

#include "prob.h"
#include "prove.h"

static void any_residual(saga_coder *c, saga_at at, int32_t *q,
                         const int16_t *mu, uint32_t step_q16,
                         const uint8_t *scale, uint32_t n)
{
    (void)at;
    (void)mu;
    (void)step_q16;
    (void)scale;
    any_bytes(q, n * sizeof *q);
    c->error |= Frama_C_interval(0, 1);
}

static uint32_t any_adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                             uint32_t n_sym)
{
    (void)at;
    (void)m;
    //@ check \valid(m);
    c->error |= Frama_C_interval(0, 1);
    return any_of(0, n_sym - 1);
}

static uint32_t any_uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    (void)at;
    c->error |= Frama_C_interval(0, 1);
    return any_of(0, (1u << bits) - 1);
}

static const saga_coder any_coder = { any_residual, any_adaptive, any_uniform,
                                      0 };

#endif
