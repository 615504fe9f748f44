/* SPDX-License-Identifier: MIT
 *
 * Memory for count elements of size bytes; the product may overflow. `what` is
 * what the memory is for: a file, or a noun ("the anchors"). Where there is
 * none, NULL is returned and the error says
 *
 *     WHAT: out of memory, N bytes wanted; take fewer ...
 *
 * No element is no failure: the pointer is not NULL then either. free() frees.
 */
#ifndef SAGA_ALLOC_H
#define SAGA_ALLOC_H

#include "error.h"

#include <stddef.h>

/* Returns memory of undefined contents. */
void *saga_alloc(size_t count, size_t size, const char *what,
                 saga_error *error);

/* Returns memory of zeros. */
void *saga_calloc(size_t count, size_t size, const char *what,
                  saga_error *error);

/* Returns p, which may be NULL, with another count; what is new has undefined
 * contents. p stays as it was where this fails. */
void *saga_realloc(void *p, size_t count, size_t size, const char *what,
                   saga_error *error);

/* Returns nbytes at a multiple of align, a power of two. */
void *saga_aligned_alloc(size_t align, size_t nbytes, const char *what,
                         saga_error *error);

#endif
