/* SPDX-License-Identifier: MIT
 *
 * Training runs a copy of the networks' parameters, and pays for their rate. A
 * tensor is a layer's weights, or its biases. Each has a step, learned as its
 * log2, and a part that is rounded to multiples of it: nothing at first, all of
 * it in the end.
 *
 *     not yet rounded    y = x + noise step (u - 1/2), u uniform in [0, 1)
 *     rounded            y = x, and x stands still
 *
 * Bits are those of a zero-mean normal distribution with the step around y as
 * its interval; common/prob.h's residuals are the integers of it. Biases have
 * one deviation, weights as the file has it: one, one for each row or one for
 * each column, by what takes the fewest bits with those of the scales counted.
 * A row or column that matters little so gets a small deviation, which draws it
 * to 0. Deviations are measured, and constants of each step of training: they
 * are those of least bits, where these do not change with them.
 *
 * Gradients. y follows x one to one. By the step's logarithm dy = (y - x) ln 2:
 * noise grows with the step.
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
    size_t at;               /* first parameter */
    size_t rows, cols;       /* biases: (n_out, 1) */
    bool int8;               /* the file has 8 bits for each weight */
} saga_weight_tensor;

typedef struct saga_weights {
    int n;                   /* tensors, in the order of params */
    saga_weight_tensor tensor[SAGA_WEIGHT_TENSORS];
    real log2_step[SAGA_WEIGHT_TENSORS];
    real d_log2_step[SAGA_WEIGHT_TENSORS]; /* and Adam's moments: */
    real m[SAGA_WEIGHT_TENSORS], v[SAGA_WEIGHT_TENSORS];
    double bits[SAGA_WEIGHT_TENSORS];      /* of the last saga_weights_rate, */
    int mode[SAGA_WEIGHT_TENSORS];         /* and SAGA_SCALE_* it took */
} saga_weights;

#define saga_weights_list SAGA_REAL_NAME(saga_weights_list)
#define saga_weights_start SAGA_REAL_NAME(saga_weights_start)
#define saga_weights_find SAGA_REAL_NAME(saga_weights_find)
#define saga_weights_step SAGA_REAL_NAME(saga_weights_step)
#define saga_weights_round SAGA_REAL_NAME(saga_weights_round)
#define saga_weights_noise SAGA_REAL_NAME(saga_weights_noise)
#define saga_weights_rate SAGA_REAL_NAME(saga_weights_rate)

/* Lists the tensors of the nets that are not the entropy model's (scene.h);
 * params is what the nets are bound into (saga_net_bind), int8 tells which nets
 * have 8 bits for a weight. Steps are 1. */
void saga_weights_list(saga_weights *w, const saga_net net[SAGA_N_NETS],
                       const uint8_t int8[SAGA_N_NETS], const real *params);

/* Sets fine steps to begin with: a 64th of each tensor's root mean square.
 * Biases, many of which are 0 by then, have at least the step of their layer's
 * weights: steps learn too slowly to come up from nothing. */
void saga_weights_start(saga_weights *w, const real *params);

/* Finds a layer's weights; its biases are the next tensor. -1: it is not among
 * them. */
int saga_weights_find(const saga_weights *w, int net, int layer);

/* Returns the step of tensor t. Biases' is the power of two next to the learned
 * one, which is all that the file can say. So is that of weights of 8 bits: the
 * file's integers are then multiples of it, where another step would be rounded
 * to so few LSB that multiples are missed by a third of it. */
double saga_weights_step(const saga_weights *w, int t);

/* Makes the copy y of x, both indexed as params: the first n_rounded tensors as
 * they are, the others with `noise` of their step. Parameters of no tensor are
 * not touched. */
void saga_weights_noise(real *y, const real *x, const saga_weights *w,
                        int n_rounded, double noise, uint64_t seed);

/* Rounds all tensors to multiples of their steps. */
void saga_weights_round(real *y, const real *x, const saga_weights *w);

/* Returns the bits of all of y, also by tensor, without those of scales. Adds
 * price times their gradient to dx, which holds that of everything else; then
 * sets the steps' gradients. */
double saga_weights_rate(real *dx, saga_weights *w, const real *y,
                         const real *x, double price);

#endif
