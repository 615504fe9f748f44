/* SPDX-License-Identifier: MIT
 *
 * Memory whose size is a product.
 */
#ifndef SAGA_ALLOC_H
#define SAGA_ALLOC_H

#include <stddef.h>

/* malloc / calloc of count x size, NULL on overflow; never zero bytes. */
void *saga_alloc(size_t count, size_t size);
void *saga_calloc(size_t count, size_t size);

#endif
