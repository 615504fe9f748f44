/* SPDX-License-Identifier: MIT */
#include "look_up.h"

/* Returns how many of n ascending suffixes have a 0 at `bit`. They must be the
 * first ones; otherwise it returns n + 1, which is not a valid symbol. */
static uint32_t count_low(const uint32_t *suffix, uint32_t n, uint32_t bit)
{
    uint32_t low = 0, i;

    while (low < n && !(suffix[low] >> bit & 1u))
        low++;
    /* A suffix with bit 0 after one with bit 1 is out of order. */
    for (i = low; i < n; i++)
        if (!(suffix[i] >> bit & 1u))
            return n + 1;
    return low;
}

uint32_t saga_look_up(const saga_symbols *s, saga_at at, uint32_t n_sym)
{
    switch (at.sym) {
    case SAGA_SYM_SPLIT:
        return at.index < s->n_nodes ? s->split[at.index] : n_sym;
    case SAGA_SYM_OCCUPANCY:
        return (uint32_t)s->occupancy[at.index] >> at.bit & 1u;
    case SAGA_SYM_N_FINE:
        return s->n_fine[at.index];
    case SAGA_SYM_CLASS:
        return s->class ? s->class[at.index] : 0;
    case SAGA_SYM_N_PRIM:
        return s->n_prim[at.index];
    case SAGA_SYM_FINE_SUFFIX:
        return count_low(s->fine_suffix + at.index, n_sym - 1, at.bit);
    default:
        return count_low(s->prim_suffix + at.index, n_sym - 1, at.bit);
    }
}

int32_t *saga_look_up_block(const saga_symbols *s, saga_at at,
                            uint32_t features)
{
    switch (at.sym) {
    case SAGA_SYM_CENTRE:
        return s->centre + 4 * (size_t)at.index;
    case SAGA_SYM_FEATURE:
        return s->feature + features * (size_t)at.index + at.column;
    case SAGA_SYM_FINE_OFFSET:
        return s->fine_offset + 4 * (size_t)at.index;
    default:
        return s->prim_offset + 4 * (size_t)at.index;
    }
}
