/* SPDX-License-Identifier: MIT
 *
 * A layer is rounded so that the errors of its weights undo each other. The
 * inputs x of a layer (P points) depend on each other, so errors e of a row
 * that are far from 0 can have outputs e . x next to it. The squared error of a
 * row's outputs is e^T H e, H the mean of x x^T with the bias as an input of 1.
 * Columns are rounded one by one, those of the largest H_cc first, the bias
 * last; the error of each is made up for by the columns still to come, as
 * linear regression tells (Hassibi and Stork's optimal brain surgeon; Frantar
 * and others' GPTQ for rounding).
 */
#ifndef SAGA_WEIGHT_ROUND_H
#define SAGA_WEIGHT_ROUND_H

#include "error.h"
#include "real.h"

#include <stddef.h>

#define saga_weight_round SAGA_REAL_NAME(saga_weight_round)

/* A layer was given x (points, stride), n_in reals of each used; it has steps
 * of weights and of biases. Both double, for the whole of a row, until no
 * weight is more than `most` steps; 0: there is no such limit. */
typedef struct saga_weight_round_input {
    const real *x;
    size_t points, stride, n_in, n_out;
    double step, bias_step;
    int most;
} saga_weight_round_input;

/* Rounds weight (n_out, n_in) and bias (n_out) to multiples of their rows'
 * steps.
 * False: no memory, and nothing was changed. */
bool saga_weight_round(real *weight, real *bias,
                       const saga_weight_round_input *in, saga_error *error);

#endif
