/* SPDX-License-Identifier: MIT
 *
 * The float twin of the memory bank in common/context.c: the bank itself
 * (bank_float.h) and the networks around it (QUERY, AGG, SLOT, WRITE_BASE,
 * WRITE), over all blocks in the order of coding, and the gradients back
 * through all rounds. Paper: Hierarchical Context Modeling, equations of the
 * write.
 *
 *     token    AGG of a decoded anchor: position, sizes, count, kind, values
 *     mean     of a run's tokens
 *     h_p      relu(WRITE_BASE(mean) + SLOT(p))
 *     v_p, w_p WRITE(h_p),  g = sigmoid(w)
 *     s_p      Norm(s + g (v - <v, s> s)), plain: Norm(s + g v)
 *     read     sum of w_p s_p, w = softmax in base 2 of <QUERY, s_p>
 *
 * What is written does not depend on what the slots hold. The networks
 * therefore run on all rounds at once, and only the update of s_p goes round by
 * round.
 *
 * A run of blocks (rate_runs.h) is a round: it reads the state before it and
 * writes the next one. Coarse anchors come first, then fine ones; primitives
 * read the last state and write nothing.
 *
 * Values are clamped where the formats of the integer path clamp them, except
 * the component of v after the projection, which would have to exceed 8.
 * Otherwise the arithmetic is real: docs/arithmetic.md bounds the difference,
 * and tests/train/test_train.c measures it.
 */
#ifndef SAGA_BANK_TWIN_H
#define SAGA_BANK_TWIN_H

#include "rate_block.h"
#include "rate_runs.h"
#include "twin.h"

typedef struct saga_bank_twin_kind {
    saga_twin_batch query; /* (blocks) in the order of the runs */
    saga_twin_batch token; /* (blocks) in the order of the runs */
    saga_twin_batch base;  /* (runs) its inputs are the means */
    saga_twin_batch write; /* (runs L) its inputs are h */
    real *d_state;         /* (runs, L, D) gradients of the state that
                            * each run read */
    real *read, *d_read;   /* (blocks, D) in the order of the runs */
} saga_bank_twin_kind;

typedef struct saga_bank_twin {
    size_t n_slots, width; /* L, D; 0: there is no bank */
    saga_bank_twin_kind kind[SAGA_N_KINDS];
    saga_twin_batch slot; /* (L) inputs: unit vectors; outputs: a vector
                           * for each slot */
    real *state;          /* (all runs + 1, L, D) the states between the
                           * runs */
    real *d_last;         /* (L, D) gradient of the last state */
    real *block;          /* the memory of all arrays above */
    real *scratch;        /* scratch of all threads */
    size_t n_threads;     /* number of threads that have scratch */
} saga_bank_twin;

/* The blocks of one kind. */
typedef struct saga_bank_twin_input {
    const saga_scene *s;
    int kind;
    const saga_rate_runs *runs;
    size_t first;             /* number of runs of the kinds before */
    const real *phase, *size; /* (blocks, 4) and (blocks, 5): see
                               * saga_rate_inputs */
    saga_rate_features x;     /* queries read the values of parents, tokens
                               * those of the block */
} saga_bank_twin_input;

#define saga_bank_twin_init SAGA_REAL_NAME(saga_bank_twin_init)
#define saga_bank_twin_free SAGA_REAL_NAME(saga_bank_twin_free)
#define saga_bank_twin_begin SAGA_REAL_NAME(saga_bank_twin_begin)
#define saga_bank_twin_write SAGA_REAL_NAME(saga_bank_twin_write)
#define saga_bank_twin_read SAGA_REAL_NAME(saga_bank_twin_read)
#define saga_bank_twin_clear SAGA_REAL_NAME(saga_bank_twin_clear)
#define saga_bank_twin_backward SAGA_REAL_NAME(saga_bank_twin_backward)
#define saga_bank_twin_end SAGA_REAL_NAME(saga_bank_twin_end)

/* Allocates memory for scenes with the counts and model of s, and sets the
 * start state. Without a bank in the model it does nothing. Returns false with
 * *error set, and nothing to free, if memory is short. */
bool saga_bank_twin_init(saga_bank_twin *m, const saga_scene *s,
                         saga_error *error);
void saga_bank_twin_free(saga_bank_twin *m);

/* Computes the vectors of the slots, before the first run. */
void saga_bank_twin_begin(saga_bank_twin *m, const saga_scene *s);

/* Writes runs from .. to - 1 of a tier into the bank. The state before the
 * first of them must be set. */
void saga_bank_twin_write(saga_bank_twin *m, const saga_bank_twin_input *in,
                          size_t from, size_t to);

/* Reads the bank for the blocks of runs from .. to - 1, whose states must be
 * set. */
void saga_bank_twin_read(saga_bank_twin *m, const saga_bank_twin_input *in,
                         size_t from, size_t to);

/* Goes back through all runs of a kind. With reads = 1 the kind has read the
 * bank, and d_read of all its blocks is set; a tier that wrote goes back
 * through its writes. Adds to the networks of d and to dx. The caller first
 * calls saga_bank_twin_clear, then this function for the kinds in reverse
 * order, and at last saga_bank_twin_end. */
void saga_bank_twin_clear(saga_bank_twin *m, const saga_scene *s);
void saga_bank_twin_backward(saga_bank_twin *m, saga_scene *d,
                             const saga_rate_features *dx,
                             const saga_bank_twin_input *in, int reads);
void saga_bank_twin_end(saga_bank_twin *m, saga_scene *d, const saga_scene *s);

#endif
