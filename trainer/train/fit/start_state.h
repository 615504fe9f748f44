/* SPDX-License-Identifier: MIT
 *
 * The inside of the start, shared by start*.c.
 */
#ifndef SAGA_START_STATE_H
#define SAGA_START_STATE_H

#include "fit_state.h"
#include "linear.h"
#include "start.h"

/* Features are limited to this magnitude: their format ends at 32, and training
 * needs some room. */
#define SAGA_MOST_FEATURE 24.0

typedef struct {
    saga_splat_params *target;
    size_t n, d, f;             /* number of primitives, of dimensions of their
                                 * attributes, and of features in use: at most
                                 * d, and further ones of the model stay 0 */
    size_t width[SAGA_N_ATTRS]; /* dimensions of each attribute; 0: the model
                                 * lacks it, or no network output gives it */
    size_t at[SAGA_N_ATTRS];    /* index of the first dimension of each */
    double *wanted, *weight;    /* (n, d) values that the networks should give,
                                 * and the weights of their squared errors */
    double *code;               /* (n, f) the features of each primitive */
    saga_matrix basis;          /* (d, f) */
    double mean[SAGA_LINEAR_MOST];
    double log2_support[4]; /* the same for all fine anchors, relative to
                             * the cell */
} saga_start;

/* start_classes.c: chooses the class of each primitive's anchor. The weights
 * are those of attributes. Returns false with *error set if memory is short. */
bool saga_start_choose_classes(const saga_start *x, saga_fit *f,
                               saga_error *error);
/* Finds basis, mean and features as saga_start_solve does, for each class by
 * itself. Returns false with *error set if memory is short. */
bool saga_start_solve_classes(saga_start *x, const saga_scene *s, double price,
                              double step, saga_error *error);
/* Sets the features that an anchor's class lacks to their values, 0 or 1. */
void saga_start_set_lacking(saga_scene *s);

/* start_solve.c */
/* Raises the weights to at least a part of their mean. */
void saga_start_raise_weights(saga_start *x);
/* Finds the basis, the mean and the features that reproduce the
 * wanted attributes with the least loss. `price` is the loss for an error of 1
 * in a feature, and `step` is the features' quantisation step. */
void saga_start_solve(saga_start *x, double price, double step);

/* start_networks.c: sets the networks and features of f's scene from the
 * supports, the basis, the mean and the features of x. */
void saga_start_set_networks(const saga_start *x, saga_fit *f);

#endif
