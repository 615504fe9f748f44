/* SPDX-License-Identifier: MIT
 *
 * What the entropy model's networks are told of a block, the order in which
 * blocks are coded, and the clamps of the integer path: for rate_context and
 * rate_memory.
 */
#ifndef SAGA_RATE_SIDE_H
#define SAGA_RATE_SIDE_H

#include "arena.h"
#include "scene.h"
#include "twin.h"

enum {
    SAGA_RATE_SIZES = 5,     /* log2 half-sizes and count, as HYPER has them */
    SAGA_RATE_OFFSETS = 5    /* a fine anchor's offset residual, and count / 16:
                              * what GROUPS reads of it, padded to F */
};

/* What the networks read: values, or their gradients. As gradients, members
 * are added to, and NULL ones are not wanted. */
typedef struct saga_rate_features {
    real *coarse;                /* (n.coarse, F) coarse features */
    real *offset;                /* (n.fine, 5) see SAGA_RATE_OFFSETS */
    real *fine;                  /* (n.fine, F) fine features, after F_fine */
} saga_rate_features;

/* Blocks of a kind in the order in which they are coded. Run i holds
 * block[begin[i]] .. block[begin[i + 1] - 1], which see nothing of one
 * another: a group's, or with a memory at most memory_blocks of them. Those of
 * primitives, which write nothing, are only a division of the work. */
typedef struct saga_rate_runs {
    uint32_t *block;             /* (blocks) ranks, ascending in a run */
    uint32_t *place;             /* (blocks) of a rank, where it is there */
    uint32_t *begin;             /* (n + 1) */
    size_t n;
} saga_rate_runs;

#define saga_rate_runs_most SAGA_REAL_NAME(saga_rate_runs_most)
#define saga_rate_runs_alloc SAGA_REAL_NAME(saga_rate_runs_alloc)
#define saga_rate_runs_free SAGA_REAL_NAME(saga_rate_runs_free)
#define saga_rate_runs_set SAGA_REAL_NAME(saga_rate_runs_set)
#define saga_rate_batch SAGA_REAL_NAME(saga_rate_batch)
#define saga_rate_side SAGA_REAL_NAME(saga_rate_side)
#define saga_rate_most SAGA_REAL_NAME(saga_rate_most)
#define saga_rate_clamp SAGA_REAL_NAME(saga_rate_clamp)
#define saga_rate_through SAGA_REAL_NAME(saga_rate_through)

/* Blocks of a kind. */
static inline size_t saga_rate_n_blocks(const saga_scene *s, int kind)
{
    return kind == SAGA_KIND_COARSE ? s->n.coarse : s->n.fine;
}

/* Most runs that scenes of s's counts and model have of a kind. */
size_t saga_rate_runs_most(const saga_scene *s, int kind);

/* 0, or -1 without memory: then, too, saga_rate_runs_free. */
int saga_rate_runs_alloc(saga_rate_runs *r, const saga_scene *s, int kind);
void saga_rate_runs_free(saga_rate_runs *r);

/* From the groups of s's anchors. */
void saga_rate_runs_set(saga_rate_runs *r, const saga_scene *s, int kind);

/* Lays out a network's batch of so many rows. */
void saga_rate_batch(saga_twin_batch *b, saga_arena *a, const saga_net *net,
                     size_t rows);

/* row[0 .. pe + 5): embedding of phase (x, y, z, t in -1..1), then the sizes;
 * returns where the next input goes. */
real *saga_rate_side(real *row, const saga_model *m, const real phase[4],
                     const real size[SAGA_RATE_SIZES]);

/* The gradient of what may have been clamped to lo..hi: towards the inside. */
static inline real saga_rate_inward(real d, real x, real lo, real hi)
{
    return (x <= lo && d > 0) || (x >= hi && d < 0) ? 0 : d;
}

/* The largest int16 in Q q. */
real saga_rate_most(int q);

/* x to +-that. */
void saga_rate_clamp(real *x, size_t n, int q);

/* Gradients of what has been clamped so. */
void saga_rate_through(real *d, const real *x, size_t n, int q);

#endif
