/* SPDX-License-Identifier: MIT
 *
 * The float twin of the memory bank in common/context.c has the bank
 * (bank_float.h) and the networks around it (QUERY, AGG, SLOT, WRITE_BASE,
 * WRITE), over all blocks in the order in which they are coded, and the
 * gradients back through all of its rounds. Paper: Hierarchical Context
 * Modeling, equations of the write.
 *
 *     token    AGG of a decoded anchor: position, sizes, count, kind, values
 *     mean     of a run's tokens
 *     h_p      relu(WRITE_BASE(mean) + SLOT(p))
 *     v_p, w_p WRITE(h_p),  g = sigmoid(w)
 *     s_p      Norm(s + g (v - <v, s> s)), plain: Norm(s + g v)
 *     read     sum of w_p s_p, w = softmax in base 2 of <QUERY, s_p>
 *
 * What is written does not depend on what the slots hold: the networks run on
 * all rounds at once, and only the last line but one goes round by round.
 *
 * A run of blocks (rate_runs.h) is a round: it reads the state before it and
 * writes the next. Coarse anchors come first, then fine ones; primitives read
 * the last state and write nothing.
 *
 * Values are clamped where the integer path's formats clamp them, but for the
 * component of v that the projection leaves, which would have to exceed 8.
 * Arithmetic is otherwise real: docs/arithmetic.md bounds the difference, and
 * tests/train/test_train.c measures it.
 */
#ifndef SAGA_BANK_TWIN_H
#define SAGA_BANK_TWIN_H

#include "rate_block.h"
#include "rate_runs.h"
#include "twin.h"

typedef struct saga_bank_twin_kind {
    saga_twin_batch query;       /* (blocks) in the order of the runs */
    saga_twin_batch token;       /* the same */
    saga_twin_batch base;        /* (runs) in: the means */
    saga_twin_batch write;       /* (runs L) in: h */
    real *d_state;               /* (runs, L, D) of what was read from them */
    real *read, *d_read;         /* (blocks, D) in that order */
} saga_bank_twin_kind;

typedef struct saga_bank_twin {
    size_t n_slots, width;       /* L, D; 0: there is none */
    saga_bank_twin_kind kind[SAGA_N_KINDS];
    saga_twin_batch slot;        /* (L) in: unit vectors; out: own vectors */
    real *state;                 /* (all runs + 1, L, D) */
    real *d_last;                /* (L, D) */
    real *block;                 /* memory of all of these */
    real *scratch;               /* of each thread */
    size_t n_threads;            /* that have some */
} saga_bank_twin;

/* A kind has these blocks. */
typedef struct saga_bank_twin_input {
    const saga_scene *s;
    int kind;
    const saga_rate_runs *runs;
    size_t first;                /* runs of the kinds before */
    const real *phase, *size;    /* (blocks, 4), (blocks, 5): saga_rate_tell */
    saga_rate_features x;        /* queries read parents', tokens their own */
} saga_bank_twin_input;

#define saga_bank_twin_init SAGA_REAL_NAME(saga_bank_twin_init)
#define saga_bank_twin_free SAGA_REAL_NAME(saga_bank_twin_free)
#define saga_bank_twin_begin SAGA_REAL_NAME(saga_bank_twin_begin)
#define saga_bank_twin_write SAGA_REAL_NAME(saga_bank_twin_write)
#define saga_bank_twin_read SAGA_REAL_NAME(saga_bank_twin_read)
#define saga_bank_twin_clear SAGA_REAL_NAME(saga_bank_twin_clear)
#define saga_bank_twin_backward SAGA_REAL_NAME(saga_bank_twin_backward)
#define saga_bank_twin_end SAGA_REAL_NAME(saga_bank_twin_end)

/* Takes memory for scenes of s's counts and model, and sets the start state;
 * does nothing if the model has no bank. False: nothing is to be freed. */
bool saga_bank_twin_init(saga_bank_twin *m, const saga_scene *s,
                         saga_error *error);
void saga_bank_twin_free(saga_bank_twin *m);

/* Sets the slots' own vectors, before the first run. */
void saga_bank_twin_begin(saga_bank_twin *m, const saga_scene *s);

/* Lets runs from .. to - 1 of a tier write, the state before the first being
 * there. */
void saga_bank_twin_write(saga_bank_twin *m,
                          const saga_bank_twin_input *in, size_t from,
                          size_t to);

/* Lets the blocks of runs from .. to - 1 read; their states are there. */
void saga_bank_twin_read(saga_bank_twin *m,
                         const saga_bank_twin_input *in, size_t from,
                         size_t to);

/* Goes back through a kind that read (reads: d_read of all its blocks is set),
 * and if a tier wrote, all its runs at once. Clear first; kinds in reverse;
 * end last. Adds to d's networks and to dx. */
void saga_bank_twin_clear(saga_bank_twin *m, const saga_scene *s);
void saga_bank_twin_backward(saga_bank_twin *m, saga_scene *d,
                             const saga_rate_features *dx,
                             const saga_bank_twin_input *in, int reads);
void saga_bank_twin_end(saga_bank_twin *m, saga_scene *d,
                        const saga_scene *s);

#endif
