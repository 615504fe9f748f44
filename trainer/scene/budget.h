/* SPDX-License-Identifier: MIT
 *
 * Divides a budget: each leaf of the tree gets fine anchors in proportion to
 * its want, within limits. Paper: Initialization and Optimization.
 */
#ifndef SAGA_BUDGET_H
#define SAGA_BUDGET_H

#include <stdint.h>

typedef struct saga_share {
    double want;     /* > 0, finite; relative to the others */
    uint32_t lo, hi; /* limits of the share, lo <= hi */
    double part;     /* scratch: the remainder after rounding down */
    uint32_t index;  /* scratch: the index in the list */
} saga_share;

/* Sets given[i], i < n, to a share of total in proportion to share[i].want and
 * within its limits. total must be at least the sum of all lo. Clamped shares
 * are scaled to the total and rounded down; the rest goes to the largest
 * remainders. The order of `share` is lost. Returns the sum of given. */
uint32_t saga_budget_divide(uint32_t *given, saga_share *share, uint32_t n,
                            uint32_t total);

#endif
