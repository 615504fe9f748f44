/* SPDX-License-Identifier: MIT */
#include "alloc.h"

#include <stdint.h>
#include <stdlib.h>

/* Returns count size, or 1 if it is 0, or SIZE_MAX if it overflows. */
static size_t product(size_t count, size_t size)
{
    if (size != 0 && count > SIZE_MAX / size)
        return SIZE_MAX;
    return count == 0 || size == 0 ? 1 : count * size;
}

/* Returns p, and sets the error if it is NULL. */
static void *checked(void *p, size_t nbytes, const char *what,
                     saga_error *error)
{
    if (!p)
        saga_no_memory(nbytes, what, error);
    return p;
}

/* malloc(SIZE_MAX) would fail anyway, but compilers and sanitizers warn about
 * it. */
static bool possible(size_t nbytes)
{
    return nbytes <= PTRDIFF_MAX;
}

void *saga_alloc(size_t count, size_t size, const char *what, saga_error *error)
{
    const size_t n = product(count, size);
    return checked(possible(n) ? malloc(n) : NULL, n, what, error);
}

void *saga_calloc(size_t count, size_t size, const char *what,
                  saga_error *error)
{
    const size_t n = product(count, size);
    return checked(possible(n) ? calloc(n, 1) : NULL, n, what, error);
}

void *saga_realloc(void *p, size_t count, size_t size, const char *what,
                   saga_error *error)
{
    const size_t n = product(count, size);
    return checked(possible(n) ? realloc(p, n) : NULL, n, what, error);
}

void *saga_aligned_alloc(size_t align, size_t nbytes, const char *what,
                         saga_error *error)
{
    /* C11 requires a multiple of align; it is never 0. */
    void *const p = possible(nbytes)
                        ? aligned_alloc(align, nbytes / align * align + align)
                        : NULL;
    return checked(p, nbytes, what, error);
}
