/* SPDX-License-Identifier: MIT
 *
 * Chooses the parts of an entropy model in training that are worth their bytes:
 * the sources of each kind and the steps of the weights. The choice is made by
 * code lengths on all blocks.
 *
 * A source that is removed is replaced by its mean: the products of its columns
 * of the first layer with the mean are added to the biases. A kind without
 * sources has measured constants. The hyperprior's network counts once, if any
 * kind reads it, and so do the networks of the bank, which is removed if no
 * kind reads it. A source is removed if that makes residuals and weights
 * together cheaper.
 *
 * The choice is made once, before the end of training: coarse features are
 * rounded against mu, so the training must adapt to whatever mu depends on.
 */
#ifndef SAGA_RATE_CHOICE_H
#define SAGA_RATE_CHOICE_H

#include "rate_loss.h"

/* Sets r->decision and the sources that r keeps, and changes the biases of s
 * (the scene of x) for the sources that are removed. Offsets, supports and
 * features are those of x's twin. Returns false with *error set, and nothing
 * decided, if memory is short. */
bool saga_rate_decide(saga_rate *r, saga_scene *s, const saga_rate_input *x,
                      saga_error *error);

/* The scene as it is packed, and the outputs of its entropy networks. */
typedef struct saga_rate_choice {
    saga_scene scene;          /* the trained scene; entropy networks and
                                * model.sources are those that were kept */
    real *params;              /* parameters of the entropy networks that were
                                * kept */
    const saga_rate *rate;     /* has the decision, the constants and the
                                * batches of all blocks */
    double bits[SAGA_N_STEPS]; /* estimated code lengths of the residuals */
} saga_rate_choice;

/* Makes c from the scene of x and the decision of r (saga_rate_decide), without
 * the sources that were not kept. r must outlive c. Returns false with *error
 * set, and nothing to free, if memory is short. */
bool saga_rate_choice_init(saga_rate_choice *c, saga_rate *r,
                           const saga_rate_input *x, saga_error *error);
void saga_rate_choice_free(saga_rate_choice *c);

/* Adds to c->bits the bits of kinds first..last, which must be coded in their
 * order, with x as for saga_rate_code. Sets their constants and the batches of
 * all their blocks. */
void saga_rate_choice_code(saga_rate_choice *c, saga_rate *r,
                           const saga_rate_input *x, int first, int last);

#endif
