/* SPDX-License-Identifier: MIT
 *
 * An arena holds arrays that are parts of one block: they are laid out once to
 * measure it (base NULL), once more to place them.
 */
#ifndef SAGA_ARENA_H
#define SAGA_ARENA_H

#include "alloc.h"
#include "real.h"

#include <stddef.h>

typedef struct saga_arena {
    real *base;
    size_t n;                /* reals taken */
} saga_arena;

/* Takes n reals at a multiple of 16; NULL while measuring. */
static inline real *saga_arena_take(saga_arena *a, size_t n)
{
    real *const p = a->base ? a->base + a->n : NULL;

    a->n += (n + 15) & ~(size_t)15;
    return p;
}

/* Returns the block that was measured, zeros (free it); taking begins anew in
 * it. */
static inline real *saga_arena_alloc(saga_arena *a, const char *what,
                                     saga_error *error)
{
    a->base = saga_calloc(a->n, sizeof *a->base, what, error);
    a->n = 0;
    return a->base;
}

#endif
