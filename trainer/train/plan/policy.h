/* SPDX-License-Identifier: MIT
 *
 * One policy says what lambda and the size of a scene decide about prices,
 * steps and widths. What does not depend on them is a constant of
 * scene_model.c.
 */
#ifndef SAGA_POLICY_H
#define SAGA_POLICY_H

#include <stdbool.h>
#include <stdint.h>

/* A primitive takes some 75 bits at the price that the rule gives. */
#define SAGA_PRIMITIVE_BITS 75.0

/* A bit costs so much in the loss (fit.h). */
typedef struct saga_prices {
    double residual;             /* of a residual, in the pictures' loss, */
    double start;                /* the same where the fit starts; */
    double weight;               /* of a weight, in the pictures' loss */
} saga_prices;

typedef struct saga_policy {
    saga_prices price;
    double prim_step;            /* step of a primitive's offset, in supports */
    uint8_t width;               /* hidden units of the networks that make
                                  * primitives of shared anchors, before the
                                  * level's cap, */
    uint8_t entropy_width;       /* and of the entropy model's */
    bool bank_pays;              /* a memory bank may be worth its networks, */
    bool deep_pays;              /* hidden units of F_geo theirs, where anchors
                                  * are not shared */
} saga_policy;

/* lambda >= 0 weighs bits per training pixel against the mean squared error in
 * 8-bit levels. There are n_pixels > 0 of them: width times height times
 * frames, over all views that are learned from. It is the same trade for every
 * scene; below 1e-3 it counts as that for prices, so
 * that the entropy networks learn what they are to code. n_primitives are those
 * asked for. */
saga_policy saga_policy_of(double lambda, double n_pixels,
                           uint32_t n_primitives);

/* Returns the lambda at which bits are worth as much in more exact primitives
 * as in more of them, where n_primitives reach the mean squared error mse > 0
 * before they are coded. */
double saga_policy_lambda(double mse, double n_pixels, uint32_t n_primitives);

/* Returns how many primitives would be in that balance with lambda > 0, where
 * n_primitives reach mse > 0. */
double saga_policy_primitives(double lambda, double mse, double n_pixels,
                              uint32_t n_primitives);

#endif
