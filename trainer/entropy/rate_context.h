/* SPDX-License-Identifier: MIT
 *
 * The float twin of common/context.c: the inputs of the networks that compute a
 * block's entropy parameters, these networks, and their gradients. Paper:
 * Hierarchical Context Modeling.
 *
 * A kind (SAGA_KIND_*) has blocks: coarse anchors; fine anchors; and fine
 * anchors again, each for the primitives under it. A pass evaluates the blocks
 * of a list.
 *
 * The sources are inputs of the network in this order, F values each, but D for
 * the last one:
 *     HYPER   the hyperprior's network at the block's position, size and count
 *     PARENT  coarse features interpolated at a fine anchor's suffix cell, or
 *             the fine anchor's own features
 *     GROUPS  neighbours of earlier groups of the block's tier
 *     BANK    the last read of the bank for the block (bank_twin.h): a constant
 *             between saga_rate_context_remember and its backward pass
 *
 * Neighbours and weights stay the same between refreshes, as in the scene's
 * twin (twin.h). No gradient flows through them, nor through positions and
 * sizes.
 *
 * mu of a fine anchor is 0, and its rows have neither weights nor gradients.
 * Therefore the decoded positions are on one grid, whatever the networks
 * become, and the trainer can put its anchors there (saga_rate_snap): the
 * offset of a primitive is tiny compared with a step of its anchor.
 *
 * Values are clamped where the formats of the integer path (s->model) clamp
 * them. A clamped output gets only gradients that lead inside.
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
    saga_rate_runs runs;       /* the order of coding */
    saga_links parent, groups; /* if the kind has such a source, by ranks of
                                * the scene */
    real *phase;               /* (blocks, 4) centres of the cells, to be
                                * embedded */
    real *size;                /* (blocks, 5) sizes of the cells; those of
                                * primitives are from the twin's last forward
                                * pass */
    /* The last forward pass sets a row for each block of its list. */
    saga_twin_batch hyper, net;
    real *mu, *d_mu;                 /* (rows, channels) in the value's unit */
    real *log2_sigma, *d_log2_sigma; /* (rows, channels) of sigma in steps */
} saga_rate_kind;

typedef struct saga_rate_context {
    saga_rate_kind kind[SAGA_N_KINDS];
    uint8_t keep[SAGA_N_KINDS]; /* SAGA_SOURCE_* bits of each kind; inputs of
                                 * the other sources are 0 and get no
                                 * gradients */
    saga_bank_twin bank;
    real *scratch; /* (blocks, F) */
    real *block;   /* the memory of the kinds' arrays and of
                    * scratch */
} saga_rate_context;

/* The blocks to evaluate, by ascending rank. */
typedef struct saga_rate_list {
    const uint32_t *block; /* (n) */
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

/* Allocates memory for scenes with the counts of s whose entropy networks have
 * at most the inputs of those of s. Later calls need no memory, except
 * saga_rate_context_refresh. At first every source of the model is in use
 * (`keep`). Returns false with *error set, and nothing to free, if memory is
 * short. */
bool saga_rate_context_init(saga_rate_context *c, const saga_scene *s,
                            saga_error *error);
void saga_rate_context_free(saga_rate_context *c);

/* Sets positions and sizes of cells, and neighbours, from the structure and
 * positions of the scene. Returns false with *error set if memory is short. */
bool saga_rate_context_refresh(saga_rate_context *c, const saga_scene *s,
                               saga_error *error);

/* Sets position and size of primitives' blocks, which are those of their fine
 * anchors in the twin's last forward pass. */
void saga_rate_place_prims(saga_rate_kind *k, const saga_scene *s,
                           const saga_twin *w, const uint32_t *block, size_t n);

/* Return the step (SAGA_STEP_*) of a channel of a kind, and the Q format of its
 * value. */
int saga_rate_step_of(int kind, size_t channel);
int saga_rate_value_q(const saga_model *m, int kind, size_t channel);

/* Tells whether a channel belongs to the position of an anchor. Its mu is 0,
 * because anchors stand on multiples of their steps from 0 (saga_rate_snap). */
static inline int saga_rate_is_anchor(int kind, size_t channel)
{
    return kind == SAGA_KIND_FINE || (kind == SAGA_KIND_COARSE && channel < 4);
}

/* The networks are trained for outputs mu in units of the largest power of two
 * that is at most the step. Then mu is about as large as log2 sigma, and the
 * same learning rate and step of weights serve both. Return this unit, in the
 * value's unit, and the Q format in which such an output is the mu of the
 * integer path. */
real saga_rate_mu_unit(const saga_model *m, int kind, size_t channel);
int saga_rate_mu_q(const saga_model *m, int kind, size_t channel);

/* Returns the sources of a kind that the scene has and the context keeps. */
uint32_t saga_rate_sources(const saga_rate_context *c, const saga_scene *s,
                           int kind);

/* Returns the number of inputs of an entropy network for one source: D for the
 * memory bank, F for the others. */
size_t saga_rate_columns(const saga_model *m, uint32_t source);

/* Sets mu and log2_sigma of the listed blocks. The kind must have sources. */
void saga_rate_context_forward(saga_rate_context *c, const saga_scene *s,
                               int kind, saga_rate_list list,
                               const saga_rate_features *x);

/* Goes back through the last forward pass from d_mu and d_log2_sigma of the
 * kind. Adds to the networks of d and to dx; sets d_read of the blocks if the
 * kind reads the bank. */
void saga_rate_context_backward(saga_rate_context *c, saga_scene *d,
                                const saga_scene *s, int kind,
                                saga_rate_list list,
                                const saga_rate_features *dx);

/* --- The bank ------------------------------------------------------------ */

/* Returns the kinds that read the bank, as bits 1 << kind; 0: the bank is not
 * used. A tier writes if it or a later kind reads. */
uint32_t saga_rate_readers(const saga_rate_context *c, const saga_scene *s);

/* Run the bank in the order of coding. saga_rate_context_begin starts it. For
 * the runs from .. to - 1 of each kind, read gives what their blocks read, if
 * the kind reads, and write adds them once they are decoded, if the kind
 * writes. x has the decoded values. */
void saga_rate_context_begin(saga_rate_context *c, const saga_scene *s);
void saga_rate_context_read(saga_rate_context *c, const saga_scene *s, int kind,
                            size_t from, size_t to,
                            const saga_rate_features *x);
void saga_rate_context_write(saga_rate_context *c, const saga_scene *s,
                             int kind, size_t from, size_t to,
                             const saga_rate_features *x);

/* Runs the bank over all kinds at once, with x in place of the decoded values.
 * Sets all d_read to 0. */
void saga_rate_context_remember(saga_rate_context *c, const saga_scene *s,
                                const saga_rate_features *x);

/* Goes back through saga_rate_context_remember from d_read. Adds to the
 * networks of d and to dx. */
void saga_rate_context_remember_backward(saga_rate_context *c, saga_scene *d,
                                         const saga_scene *s,
                                         const saga_rate_features *x,
                                         const saga_rate_features *dx);

#endif
