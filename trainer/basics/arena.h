/* SPDX-License-Identifier: MIT
 *
 * An arena places several arrays in one block. The caller takes all arrays
 * twice: once with base NULL, to measure the block, and once to place them.
 */
#ifndef SAGA_ARENA_H
#define SAGA_ARENA_H

#include "alloc.h"
#include "real.h"

#include <stddef.h>

typedef struct saga_arena {
    real *base;
    size_t n; /* number of reals taken */
} saga_arena;

/* Takes n reals at a multiple of 16 reals. Returns NULL while the block is
 * measured. */
static inline real *saga_arena_take(saga_arena *a, size_t n)
{
    real *const p = a->base ? a->base + a->n : NULL;

    a->n += (n + 15) & ~(size_t)15;
    return p;
}

/* Allocates the measured block, zeroed, and starts again at its beginning. The
 * caller frees it by free(). Returns NULL with *error set on failure. */
static inline real *saga_arena_alloc(saga_arena *a, const char *what,
                                     saga_error *error)
{
    a->base = saga_calloc(a->n, sizeof *a->base, what, error);
    a->n = 0;
    return a->base;
}

#endif
