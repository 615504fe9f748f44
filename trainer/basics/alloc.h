/* SPDX-License-Identifier: MIT
 *
 * These functions allocate memory for count elements of size bytes, and check
 * the product for overflow. `what` names the memory in the error: a file, or a
 * noun such as "the anchors". On failure they return NULL with the error
 *
 *     WHAT: out of memory, N bytes wanted; take fewer ...
 *
 * For 0 elements the pointer is not NULL. The caller frees the memory by
 * free().
 */
#ifndef SAGA_ALLOC_H
#define SAGA_ALLOC_H

#include "error.h"

#include <stddef.h>

/* Returns uninitialised memory. */
void *saga_alloc(size_t count, size_t size, const char *what,
                 saga_error *error);

/* Returns zeroed memory. */
void *saga_calloc(size_t count, size_t size, const char *what,
                  saga_error *error);

/* Resizes p, which may be NULL, to another count. New elements are
 * uninitialised. On failure p stays valid and unchanged. */
void *saga_realloc(void *p, size_t count, size_t size, const char *what,
                   saga_error *error);

/* Returns nbytes bytes at a multiple of align, a power of two. */
void *saga_aligned_alloc(size_t align, size_t nbytes, const char *what,
                         saga_error *error);

#endif
