/* SPDX-License-Identifier: MIT
 *
 * One policy: what lambda and the size of a scene decide about prices, steps
 * and widths. What does not depend on them is a constant of train_model.c.
 */
#ifndef SAGA_POLICY_H
#define SAGA_POLICY_H

#include <stdbool.h>
#include <stdint.h>

/* What bits cost in distortion where nobody says otherwise. */
#define SAGA_DEFAULT_LAMBDA 0.0005

/* What a bit costs in the loss (fit.h). */
typedef struct saga_prices {
    double residual;             /* of a residual, in the pictures' loss, */
    double regression;           /* in that of the regression; */
    double weight;               /* of a weight, in the pictures' loss */
} saga_prices;

typedef struct saga_policy {
    saga_prices price;
    double prim_step;            /* step of a primitive's offset, in supports */
    uint8_t features;            /* F */
    uint8_t width;               /* hidden units of the networks that make
                                  * primitives, before the level's cap, */
    uint8_t entropy_width;       /* and of the entropy model's */
    bool bank_pays;              /* a memory bank may be worth its networks */
} saga_policy;

/* lambda >= 0; n_primitives and n_coarse as asked for; n_symbols: values of
 * coarse features. */
saga_policy saga_policy_of(double lambda, uint32_t n_primitives,
                           uint32_t n_coarse, double n_symbols);

#endif
