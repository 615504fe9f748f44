/* SPDX-License-Identifier: MIT
 *
 * The order in which the blocks of a scene are coded, and its division into
 * runs.
 */
#ifndef SAGA_RATE_RUNS_H
#define SAGA_RATE_RUNS_H

#include "scene.h"

/* The blocks of a kind in the order of coding. Run i has block[begin[i]] ..
 * block[begin[i + 1] - 1], whose contexts do not depend on each other: they are
 * the blocks of a group or, with a bank, at most bank_blocks of them. Runs of
 * primitives, which write nothing, only divide the work. */
typedef struct saga_rate_runs {
    uint32_t *block; /* (blocks) a block's rank among the blocks of
                      * its kind; ascending within a run */
    uint32_t *index; /* (blocks) the inverse: where in `block` the
                      * block of each rank is */
    uint32_t *begin; /* (n + 1) where in `block` each run begins */
    size_t n;        /* number of runs */
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

/* Returns the largest number of runs of a kind in scenes with the counts and
 * model of s. */
size_t saga_rate_runs_most(const saga_scene *s, int kind);

/* Allocates memory for the runs of a kind (saga_rate_runs_most). Returns false
 * with *error set if memory is short; saga_rate_runs_free must be called in
 * either case. */
bool saga_rate_runs_alloc(saga_rate_runs *r, const saga_scene *s, int kind,
                          saga_error *error);
void saga_rate_runs_free(saga_rate_runs *r);

/* Sets the runs from the groups of s's anchors. */
void saga_rate_runs_set(saga_rate_runs *r, const saga_scene *s, int kind);

#endif
