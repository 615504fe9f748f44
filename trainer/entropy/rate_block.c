/* SPDX-License-Identifier: MIT */
#include "rate_block.h"

#include "embedding.h"

#include <string.h>

/* --- Inputs -------------------------------------------------------------- */

real *saga_rate_inputs(real *row, const saga_model *m, const real phase[4],
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
        d[i] = saga_inward(d[i], x[i], -most, most);
}
