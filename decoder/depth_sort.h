/* SPDX-License-Identifier: MIT
 *
 * The total order of drawing: by (depth, index).
 */
#ifndef SAGA_DEPTH_SORT_H
#define SAGA_DEPTH_SORT_H

#include <stdint.h>

typedef struct saga_key {
    uint32_t depth;
    uint32_t index;
} saga_key;

/* Sorts keys[0..n) by depth with a radix sort, in time proportional to n. The
 * sort is stable, so that keys given in the order of their indices are sorted
 * by (depth, index). tmp has n entries. */
void saga_depth_sort(saga_key *keys, saga_key *tmp, uint32_t n);

#endif
