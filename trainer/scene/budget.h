/* SPDX-License-Identifier: MIT
 *
 * A budget is divided: each leaf of the tree gets fine anchors in proportion to
 * what it wants, within its limits. Paper: Initialization and Optimization.
 */
#ifndef SAGA_BUDGET_H
#define SAGA_BUDGET_H

#include <stdint.h>

typedef struct saga_share {
    double want;             /* > 0, finite; relative to the others' */
    uint32_t lo, hi;         /* limits, lo <= hi */
    double part;             /* scratch: what rounding down leaves, */
    uint32_t index;          /* and where it was in the list */
} saga_share;

/* Sets given[i], i < n, within the limits of share[i] and, as far as these let
 * it, to its part of total (at least the sum of all lo). Clamped shares are
 * scaled to the total and rounded down, what is left goes to the largest
 * remainders. The list's order is lost. Returns the sum of all given. */
uint32_t saga_budget_divide(uint32_t *given, saga_share *share, uint32_t n,
                            uint32_t total);

#endif
