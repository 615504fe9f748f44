/* SPDX-License-Identifier: MIT
 *
 * The inside of the start, which start*.c share.
 */
#ifndef SAGA_START_STATE_H
#define SAGA_START_STATE_H

#include "fit_state.h"
#include "linear.h"
#include "start.h"

/* Features are kept within this magnitude: their format ends at 32, and
 * training needs some room. */
#define SAGA_MOST_FEATURE 24.0

typedef struct {
    saga_splat_params *target;
    size_t n, d, f;              /* primitives, dimensions, features; more
                                  * features than dimensions stay 0 */
    size_t width[SAGA_N_ATTRS];  /* dimensions of each attribute; 0: the model
                                  * has it not, or networks do not give it */
    size_t at[SAGA_N_ATTRS];     /* the first of them */
    double *wanted, *weight;     /* (n, d) */
    double *code;                /* (n, f) */
    saga_matrix basis;           /* (d, f) */
    double mean[SAGA_LINEAR_MOST];
    double log2_support[4];      /* of fine anchors, relative to the cell */
} saga_start;

/* start_solve.c: finds basis, mean and features of what is wanted. price: of a
 * feature's unit error, step: its quantisation step. */
void saga_start_solve(saga_start *x, double price, double step);

/* start_networks.c: sets networks and features of f's scene to the supports,
 * the basis, the mean and the features that were found. */
void saga_start_set_networks(const saga_start *x, saga_fit *f);

#endif
