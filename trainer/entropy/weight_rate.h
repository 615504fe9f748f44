/* SPDX-License-Identifier: MIT
 *
 * Training runs on a copy of the networks' weights and pays for their rate. A
 * tensor is the weights of a layer, or its biases. Each tensor has a step,
 * which is learned as its log2. It is either not rounded yet or rounded to
 * multiples of the step:
 *
 *     not yet rounded    y = x + noise step (u - 1/2), u uniform in [0, 1)
 *     rounded, or fixed  y = x, and x is frozen
 *
 * Bits are those of a zero-mean normal distribution, integrated over one step
 * around y; the residuals of common/prob.h are the integers of the same
 * distribution. Biases have one deviation. Weights have one, one for each row
 * or one for each column, whichever takes the fewest bits with the scales
 * included, as in the file. A row or column that matters little thus gets a
 * small deviation, which draws it to 0. The deviations are those with the
 * fewest bits for the present weights, measured at each iteration; gradients
 * treat them as constants.
 *
 * Gradients: y follows x one to one, and by the logarithm of the step
 * dy = (y - x) ln 2, since noise grows with the step.
 */
#ifndef SAGA_WEIGHT_RATE_H
#define SAGA_WEIGHT_RATE_H

#include "model.h"
#include "net.h"
#include "real.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

enum { SAGA_WEIGHT_TENSORS = 2 * SAGA_N_NETS * SAGA_NET_LAYERS };

/* Even tensors are weights, odd ones are the biases of the same layer. */
typedef struct saga_weight_tensor {
    int net, layer;
    size_t at;         /* index of the first parameter in params */
    size_t rows, cols; /* size of the matrix; biases have (n_out, 1) */
    bool int8;         /* weights have 8 bits in the file */
    bool fixed;        /* multiples of their step that stay as they are */
} saga_weight_tensor;

typedef struct saga_weights {
    int n; /* number of tensors, in the order of params */
    saga_weight_tensor tensor[SAGA_WEIGHT_TENSORS];
    real log2_step[SAGA_WEIGHT_TENSORS];
    real d_log2_step[SAGA_WEIGHT_TENSORS]; /* gradients; Adam's moments are m
                                            * and v */
    real m[SAGA_WEIGHT_TENSORS], v[SAGA_WEIGHT_TENSORS];
    double bits[SAGA_WEIGHT_TENSORS]; /* bits at the last
                                       * saga_weights_rate */
    int mode[SAGA_WEIGHT_TENSORS];    /* SAGA_SCALE_*, the deviations that
                                       * took the fewest bits */
} saga_weights;

#define saga_weights_list SAGA_REAL_NAME(saga_weights_list)
#define saga_weights_start SAGA_REAL_NAME(saga_weights_start)
#define saga_weights_fix SAGA_REAL_NAME(saga_weights_fix)
#define saga_weights_find SAGA_REAL_NAME(saga_weights_find)
#define saga_weights_step SAGA_REAL_NAME(saga_weights_step)
#define saga_weights_round SAGA_REAL_NAME(saga_weights_round)
#define saga_weights_noise SAGA_REAL_NAME(saga_weights_noise)
#define saga_weights_rate SAGA_REAL_NAME(saga_weights_rate)

/* Lists the tensors of all nets except the entropy model's (scene.h). params is
 * the array into which the nets are bound (saga_net_bind); int8 tells which
 * nets have weights of 8 bits. Steps are set to 1. */
void saga_weights_list(saga_weights *w, const saga_net net[SAGA_N_NETS],
                       const uint8_t int8[SAGA_N_NETS], const real *params);

/* Sets the initial steps to a 64th of each tensor's root mean square. The step
 * of biases, many of which are 0 then, is at least that of their layer's
 * weights, because steps learn too slowly to grow from nothing. */
void saga_weights_start(saga_weights *w, const real *params);

/* Fixes a network of one layer, whose weights are whole numbers and whose
 * biases are multiples of 2^-SAGA_FIXED_BIAS. It has no noise and no rate, and
 * its gradients are removed. */
enum { SAGA_FIXED_BIAS = 4 };
void saga_weights_fix(saga_weights *w, int net);

/* Returns the tensor of a layer's weights, or -1 if it has none. The next
 * tensor has its biases. */
int saga_weights_find(const saga_weights *w, int net, int layer);

/* Returns the step of tensor t. For biases, and for weights of 8 bits, it is
 * the power of two nearest to the learned step. Biases can have no other step
 * in the file. For weights of 8 bits, the integers in the file are multiples of
 * this step; another step would be rounded to so few units that multiples would
 * be off by up to a third of it. */
double saga_weights_step(const saga_weights *w, int t);

/* Sets y to x, both indexed like params: the first n_rounded tensors unchanged,
 * the others with noise of `noise` times their step. Parameters outside of all
 * tensors are left alone. */
void saga_weights_noise(real *y, const real *x, const saga_weights *w,
                        int n_rounded, double noise, uint64_t seed);

/* Sets all tensors in y to x rounded to multiples of their steps. */
void saga_weights_round(real *y, const real *x, const saga_weights *w);

/* Returns the bits of all of y, without those of scales, and sets them for each
 * tensor. Adds price times their gradient to dx, which must already hold all
 * other gradients, and then sets the gradients of the steps. */
double saga_weights_rate(real *dx, saga_weights *w, const real *y,
                         const real *x, double price);

#endif
