/* SPDX-License-Identifier: MIT */
#include "rate_block.h"

#include "embedding.h"

#include <string.h>

/* --- Inputs -------------------------------------------------------------- */

void saga_rate_batch(saga_twin_batch *b, saga_arena *a, const saga_net *net,
                     size_t rows)
{
    const size_t in = (size_t)net->dim[0];
    const size_t out = (size_t)net->dim[net->n_layers];

    b->in = saga_arena_take(a, rows * in);
    b->d_in = saga_arena_take(a, rows * in);
    b->out = saga_arena_take(a, rows * out);
    b->d_out = saga_arena_take(a, rows * out);
}

real *saga_rate_tell(real *row, const saga_model *m, const real phase[4],
                     const real size[SAGA_RATE_SIZES])
{
    real *const sizes = row + saga_pe_size(m);

    saga_embedding_forward(row, saga_pe_size(m), phase, 1, 4, m->octaves);
    memcpy(sizes, size, SAGA_RATE_SIZES * sizeof *row);
    return sizes + SAGA_RATE_SIZES;
}

/* --- Clamps -------------------------------------------------------------- */

real saga_rate_most(int q)
{
    return R(32767) / R(1 << q);
}

void saga_rate_clamp(real *x, size_t n, int q)
{
    const real most = saga_rate_most(q);
    size_t i;

    for (i = 0; i < n; i++)
        x[i] = saga_clamp(x[i], -most, most);
}

void saga_rate_through(real *d, const real *x, size_t n, int q)
{
    const real most = saga_rate_most(q);
    size_t i;

    for (i = 0; i < n; i++)
        d[i] = saga_rate_inward(d[i], x[i], -most, most);
}
