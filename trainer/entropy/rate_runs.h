/* SPDX-License-Identifier: MIT
 *
 * The blocks of a scene are coded in an order, in runs.
 */
#ifndef SAGA_RATE_RUNS_H
#define SAGA_RATE_RUNS_H

#include "scene.h"

/* The blocks of a kind stand in the order in which they are coded. Run i holds
 * block[begin[i]] .. block[begin[i + 1] - 1], which see nothing of one another:
 * a group's, or with a bank at most bank_blocks of them. Those of
 * primitives, which write nothing, are only a division of the work. */
typedef struct saga_rate_runs {
    uint32_t *block;             /* (blocks) ranks, ascending in a run */
    uint32_t *index;             /* (blocks) of a rank, where it is there */
    uint32_t *begin;             /* (n + 1) */
    size_t n;
} saga_rate_runs;

#define saga_rate_runs_most SAGA_REAL_NAME(saga_rate_runs_most)
#define saga_rate_runs_alloc SAGA_REAL_NAME(saga_rate_runs_alloc)
#define saga_rate_runs_free SAGA_REAL_NAME(saga_rate_runs_free)
#define saga_rate_runs_set SAGA_REAL_NAME(saga_rate_runs_set)

/* Returns how many blocks a kind has. */
static inline size_t saga_rate_n_blocks(const saga_scene *s, int kind)
{
    return kind == SAGA_KIND_COARSE ? s->n.coarse : s->n.fine;
}

/* Returns the most runs that scenes of s's counts and model have of a kind. */
size_t saga_rate_runs_most(const saga_scene *s, int kind);

/* Makes room for those. saga_rate_runs_free it also after a failure. */
bool saga_rate_runs_alloc(saga_rate_runs *r, const saga_scene *s, int kind,
                          saga_error *error);
void saga_rate_runs_free(saga_rate_runs *r);

/* Sets the runs from the groups of s's anchors. */
void saga_rate_runs_set(saga_rate_runs *r, const saga_scene *s, int kind);

#endif
