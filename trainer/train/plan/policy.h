/* SPDX-License-Identifier: MIT
 *
 * The policy derives prices, quantiser steps and network widths from lambda and
 * the size of a scene. Settings that do not depend on them are constants in
 * scene_model.c.
 */
#ifndef SAGA_POLICY_H
#define SAGA_POLICY_H

#include <stdbool.h>
#include <stdint.h>

/* A primitive takes about 75 bits in a file at the lambda of
 * saga_policy_lambda. */
#define SAGA_PRIMITIVE_BITS 75.0

/* Frames of the longest film whose features learn at the whole rate. Those of
 * longer ones learn more slowly, and take fewer bytes (docs/lab/films.md). */
#define SAGA_SHORT_FILM 32.0

/* The training loss (fit.h) adds these prices to the squared error for each
 * bit. */
typedef struct saga_prices {
    double residual; /* price of a bit of a residual, while
                      * training */
    double start;    /* price of a bit of a residual, in the solve
                      * that starts the fit */
    double weight;   /* price of a bit of a network's weight, while
                      * training */
} saga_prices;

typedef struct saga_policy {
    double lambda; /* what all members follow from. In a training it is the
                    * option, and from the end of the warm-up on what
                    * saga_policy_lambda or the wanted size gave; 0: open */
    saga_prices price;
    double prim_step;      /* step of a primitive's offset, in supports */
    uint8_t width;         /* hidden units of the networks that make
                            * primitives of shared anchors, before the
                            * level's limit */
    uint8_t entropy_width; /* hidden units of the entropy networks */
    bool deep_pays;        /* a hidden layer of F_geo may save more than
                            * it takes, where anchors are not shared */
} saga_policy;

/* Returns the policy for these sizes. lambda >= 0 is the price of bits per
 * training pixel against the mean squared error in 8-bit levels, so that it
 * means the same trade for every scene. Prices use at least 1e-3, since without
 * a price the entropy networks would not learn. n_pixels > 0 is the number of
 * training pixels: width times height times frames, summed over all training
 * views. n_primitives is the number that was asked for. */
saga_policy saga_policy_of(double lambda, double n_pixels,
                           uint32_t n_primitives);

/* Returns the lambda at which a bit lowers the error as much when it codes
 * primitives more exactly as when it pays for more primitives, where
 * n_primitives reach the mean squared error mse > 0 (of values 0..1) before
 * they are coded. */
double saga_policy_lambda(double mse, double n_pixels, uint32_t n_primitives);

/* Returns the number of primitives for which saga_policy_lambda would give
 * lambda > 0, where n_primitives reach the mean squared error mse > 0. */
double saga_policy_primitives(double lambda, double mse, double n_pixels,
                              uint32_t n_primitives);

#endif
