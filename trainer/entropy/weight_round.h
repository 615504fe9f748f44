/* SPDX-License-Identifier: MIT
 *
 * Rounds a layer so that the errors of its weights compensate each other. The
 * inputs x of a layer (at P points) are correlated, so a row of errors e can be
 * large and still change the outputs e . x little. The squared error of a row's
 * outputs is e^T H e, where H is the mean of x x^T with the bias as an input of
 * 1. Columns are rounded one by one, those with the largest H_cc first and the
 * bias last. The columns still to come compensate for the error of each, by
 * linear regression (Hassibi and Stork's optimal brain surgeon; Frantar and
 * others' GPTQ for rounding).
 */
#ifndef SAGA_WEIGHT_ROUND_H
#define SAGA_WEIGHT_ROUND_H

#include "error.h"
#include "real.h"

#include <stddef.h>

#define saga_weight_round SAGA_REAL_NAME(saga_weight_round)

/* The inputs of a layer and its steps. x has `points` rows, `stride` reals
 * apart, of which n_in are used. If a weight would exceed `most` steps, both
 * steps are doubled for its whole row until none does; 0: no limit. */
typedef struct saga_weight_round_input {
    const real *x;
    size_t points, stride, n_in, n_out;
    double step, bias_step;
    int most;
} saga_weight_round_input;

/* Rounds weight (n_out, n_in) and bias (n_out) to multiples of their rows'
 * steps. Returns false with *error set, and nothing changed, if memory is
 * short. */
bool saga_weight_round(real *weight, real *bias,
                       const saga_weight_round_input *in, saga_error *error);

#endif
