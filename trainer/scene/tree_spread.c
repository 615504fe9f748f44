/* SPDX-License-Identifier: MIT */
#include "tree.h"

#include "alloc.h"

#include <stdlib.h>

/* Each pass needs fewer candidates in a cell than the one before, so that cells
 * that a pass has filled up become free again. */
enum { MOST_PASSES = 8 };

/* A candidate and its deepest cell, with 16 bits each for x, y, z and time. */
typedef struct {
    uint64_t cell;
    uint32_t index;
} placed;

static int by_cell(const void *a, const void *b)
{
    const placed *const p = a, *const q = b;

    return p->cell != q->cell ? (p->cell > q->cell) - (p->cell < q->cell)
                              : (p->index > q->index) - (p->index < q->index);
}

static void sort_cells(placed *p, const saga_tree *t)
{
    for (uint32_t i = 0; i < t->n; i++) {
        const uint32_t *const u = t->cand[i].u;
        uint64_t cell = 0;

        for (int k = 0; k < 3; k++)
            cell = cell << 16 | u[k] >> (SAGA_TREE_LOG2_X - t->max_x);
        cell = cell << 16 |
               (t->dynamic ? u[3] >> (SAGA_TREE_LOG2_T - t->max_t) : 0);
        p[i] = (placed){ cell, i };
    }
    qsort(p, t->n, sizeof *p, by_cell);
}

/* Moves the m candidates of a cell into a block of cells around it, at most
 * `most` into each. */
static void spread_cell(saga_tree *t, const placed *p, uint32_t m,
                        uint32_t most)
{
    const uint32_t n_cells = 1u << t->max_x, needed = (m + most - 1) / most;
    uint32_t side = 1;

    while ((uint64_t)side * side * side < needed)
        side++;
    for (uint32_t j = 0; j < m; j++) {
        const uint32_t spot = j / most;
        const uint32_t at[3] = { spot % side, spot / side % side,
                                 spot / side / side };
        saga_candidate *const c = &t->cand[p[j].index];

        for (int k = 0; k < 3; k++) {
            const uint32_t from = c->u[k] >> (SAGA_TREE_LOG2_X - t->max_x);
            /* The block is moved into the cube if it would reach out of it. */
            const uint32_t low = from < side / 2 ? 0 : from - side / 2;
            const uint32_t first = low + side > n_cells ? n_cells - side : low;
            const int32_t step = (int32_t)(first + at[k]) - (int32_t)from;

            c->u[k] += (uint32_t)step << (SAGA_TREE_LOG2_X - t->max_x);
            c->phi[k] += 2.0 * step / n_cells;
        }
    }
}

/* Spreads all cells with too many candidates. Returns how many there were. */
static uint32_t spread_all(saga_tree *t, placed *p, uint32_t limit,
                           uint32_t most)
{
    uint32_t n = 0, end;

    sort_cells(p, t);
    for (uint32_t i = 0; i < t->n; i = end) {
        for (end = i + 1; end < t->n && p[end].cell == p[i].cell; end++)
            ;
        if (end - i <= limit)
            continue;
        spread_cell(t, p + i, end - i, most);
        n++;
    }
    return n;
}

bool saga_tree_spread(saga_tree *t)
{
    const uint32_t limit = t->c_coarse * t->c_fine;
    placed *const p = saga_alloc(t->n, sizeof *p, "the tree", t->error);
    uint32_t left = p ? 1 : 0;

    for (int pass = 0; pass < MOST_PASSES && left; pass++)
        left = spread_all(t, p, limit, limit >> pass ? limit >> pass : 1);
    free(p);
    return p && (left == 0 ||
                 saga_fail(t->error, NULL, "merge those that lie at one point",
                           "more than %u primitives share each of %u places",
                           limit, left));
}
