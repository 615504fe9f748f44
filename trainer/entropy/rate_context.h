/* SPDX-License-Identifier: MIT
 *
 * The float twin of common/context.c has what a block's entropy parameters are
 * computed from, the networks that do it, and the gradients back. Paper:
 * Hierarchical Context Modeling.
 *
 * A kind (SAGA_KIND_*) has blocks: coarse anchors; fine anchors; fine anchors
 * again, each for the primitives under it. Evaluated are the blocks of a list.
 *
 * Sources, in the order of the network's input, F values each, the last D:
 *     HYPER   the hyperprior's network at the block's position, size and count
 *     PARENT  coarse features interpolated at a fine anchor's suffix cell, or
 *             the fine anchor's own features
 *     GROUPS  neighbours of earlier groups of the block's tier
 *     MEMORY  what was last read for the block (bank_twin.h): a constant
 *             between saga_rate_context_remember and its backward pass
 *
 * Neighbours and weights stand still between refreshes, as the scene's twin's
 * do (twin.h); no gradient flows through them, nor through places and sizes.
 * A fine anchor's mu is 0: its rows have neither weights nor gradient. What is
 * decoded then lies on one grid whatever the networks become, and the trainer
 * can put its anchors there (saga_rate_snap): an offset of a primitive is tiny
 * against a step of its anchor's.
 *
 * Values are clamped where the integer path's formats (s->model) clamp them; a
 * clamped output learns only towards the inside.
 */
#ifndef SAGA_RATE_CONTEXT_H
#define SAGA_RATE_CONTEXT_H

#include "links.h"
#include "bank_twin.h"
#include "rate_block.h"
#include "rate_runs.h"
#include "twin.h"

typedef struct saga_rate_kind {
    size_t n_blocks;
    saga_rate_runs runs;         /* the order of coding */
    saga_links parent, groups;   /* where the kind has them (scene's ranks) */
    real *phase;                 /* (blocks, 4) of the cells, as embedded; */
    real *size;                  /* (blocks, 5). Primitives: by the twin, as
                                  * the last forward pass had it */
    /* The last forward pass left a row for each block of its list. */
    saga_twin_batch hyper, net;
    real *mu, *d_mu;             /* (rows, channels) reals of the value */
    real *log2_sigma, *d_log2_sigma; /* (rows, channels) of sigma in steps */
} saga_rate_kind;

typedef struct saga_rate_context {
    saga_rate_kind kind[SAGA_N_KINDS];
    uint8_t keep[SAGA_N_KINDS];  /* SAGA_SOURCE_*: the other sources' inputs
                                  * are 0, and learn nothing */
    saga_bank_twin bank;
    real *scratch;               /* (blocks, F) */
    real *block;                 /* memory of the kinds' and of scratch */
} saga_rate_context;

/* A list says which blocks are evaluated: ranks, ascending. */
typedef struct saga_rate_list {
    const uint32_t *block;       /* (n) */
    size_t n;
} saga_rate_list;

#define saga_rate_context_init SAGA_REAL_NAME(saga_rate_context_init)
#define saga_rate_context_free SAGA_REAL_NAME(saga_rate_context_free)
#define saga_rate_context_refresh SAGA_REAL_NAME(saga_rate_context_refresh)
#define saga_rate_place_prims SAGA_REAL_NAME(saga_rate_place_prims)
#define saga_rate_step_of SAGA_REAL_NAME(saga_rate_step_of)
#define saga_rate_value_q SAGA_REAL_NAME(saga_rate_value_q)
#define saga_rate_mu_unit SAGA_REAL_NAME(saga_rate_mu_unit)
#define saga_rate_mu_q SAGA_REAL_NAME(saga_rate_mu_q)
#define saga_rate_sources SAGA_REAL_NAME(saga_rate_sources)
#define saga_rate_columns SAGA_REAL_NAME(saga_rate_columns)
#define saga_rate_context_forward SAGA_REAL_NAME(saga_rate_context_forward)
#define saga_rate_context_backward SAGA_REAL_NAME(saga_rate_context_backward)
#define saga_rate_readers SAGA_REAL_NAME(saga_rate_readers)
#define saga_rate_context_begin SAGA_REAL_NAME(saga_rate_context_begin)
#define saga_rate_context_read SAGA_REAL_NAME(saga_rate_context_read)
#define saga_rate_context_write SAGA_REAL_NAME(saga_rate_context_write)
#define saga_rate_context_remember SAGA_REAL_NAME(saga_rate_context_remember)
#define saga_rate_context_remember_backward \
    SAGA_REAL_NAME(saga_rate_context_remember_backward)

/* Takes memory for scenes of s's counts whose entropy networks have at most s's
 * inputs, and for all that is done with them but saga_rate_context_refresh; all
 * sources are kept. False: nothing is to be freed. */
bool saga_rate_context_init(saga_rate_context *c, const saga_scene *s,
                            saga_error *error);
void saga_rate_context_free(saga_rate_context *c);

/* Sets cells' positions and sizes, and neighbours, from the scene's structure
 * and positions. False: no memory. */
bool saga_rate_context_refresh(saga_rate_context *c, const saga_scene *s,
                               saga_error *error);

/* Sets the places of primitives' blocks, which are their fine anchors', and
 * their sizes, from the twin's last forward pass. */
void saga_rate_place_prims(saga_rate_kind *k, const saga_scene *s,
                           const saga_twin *w, const uint32_t *block,
                           size_t n);

/* A kind's channel has a step (SAGA_STEP_*), and its value a Q. */
int saga_rate_step_of(int kind, size_t channel);
int saga_rate_value_q(const saga_model *m, int kind, size_t channel);

/* Tells whether a channel is the position of an anchor, coarse or fine. Its mu
 * is 0: the anchors stand where their steps from 0 lead (saga_rate_snap). */
static inline int saga_rate_is_anchor(int kind, size_t channel)
{
    return kind == SAGA_KIND_FINE ||
           (kind == SAGA_KIND_COARSE && channel < 4);
}

/* The networks' weights are trained for outputs mu in units of the power of two
 * at or below the step, as large as log2 sigma, so that one learning rate and
 * one step of the weights serve both: unit in reals of the value, and the Q in
 * which such an output is the integer path's mu. */
real saga_rate_mu_unit(const saga_model *m, int kind, size_t channel);
int saga_rate_mu_q(const saga_model *m, int kind, size_t channel);

/* Returns the sources of a kind that the scene has and the context keeps. */
uint32_t saga_rate_sources(const saga_rate_context *c, const saga_scene *s,
                           int kind);

/* Returns how many inputs of an entropy network are one source's: F, of the
 * memory bank D. */
size_t saga_rate_columns(const saga_model *m, uint32_t source);

/* Sets mu and log2_sigma of the listed blocks, of kinds with such sources only.
 */
void saga_rate_context_forward(saga_rate_context *c, const saga_scene *s,
                               int kind, saga_rate_list list,
                               const saga_rate_features *x);

/* Goes back through the same forward pass, from the kind's d_mu and
 * d_log2_sigma: adds to d's networks and to dx, and sets the blocks' d_read
 * where the kind reads the bank. */
void saga_rate_context_backward(saga_rate_context *c, saga_scene *d,
                                const saga_scene *s, int kind,
                                saga_rate_list list,
                                const saga_rate_features *dx);

/* --- The bank ------------------------------------------------------------ */

/* Returns the kinds that read it, as bits 1 << kind; 0: it does not run. A
 * tier writes if it reads or one of the kinds after it. */
uint32_t saga_rate_readers(const saga_rate_context *c, const saga_scene *s);

/* They run it in the order of coding: begin; of each kind, run by run, what
 * the blocks of runs from .. to - 1 read, if the kind reads, and what they
 * write once they are decoded, if it writes. x: what is decoded. */
void saga_rate_context_begin(saga_rate_context *c, const saga_scene *s);
void saga_rate_context_read(saga_rate_context *c, const saga_scene *s,
                            int kind, size_t from, size_t to,
                            const saga_rate_features *x);
void saga_rate_context_write(saga_rate_context *c, const saga_scene *s,
                             int kind, size_t from, size_t to,
                             const saga_rate_features *x);

/* Runs all of it at once, x standing for what will be decoded; all d_read
 * become 0. */
void saga_rate_context_remember(saga_rate_context *c, const saga_scene *s,
                                const saga_rate_features *x);

/* Goes back through that, from d_read: adds to d's networks and to dx. */
void saga_rate_context_remember_backward(saga_rate_context *c, saga_scene *d,
                                         const saga_scene *s,
                                         const saga_rate_features *x,
                                         const saga_rate_features *dx);

#endif
