/* SPDX-License-Identifier: MIT
 *
 * Code lengths on all blocks choose what of an entropy model in training is
 * worth its bytes: sources of each kind and the steps of the weights.
 *
 * A source that is left out is replaced by its mean: its columns of the first
 * layer move into the biases. A kind without any has measured constants. The
 * hyperprior's network counts once, if any kind reads it, and so do those of
 * the bank, which is no more once nobody reads it. Left out is whatever makes
 * residuals and weights together dearer.
 *
 * Decided once, while there is training left: coarse features are rounded
 * against mu, so everything has to settle on what decides mu.
 */
#ifndef SAGA_RATE_CHOICE_H
#define SAGA_RATE_CHOICE_H

#include "rate_loss.h"

/* Sets r->decision and the sources that r keeps; s (x's scene) gets the biases
 * of what is left out. The twin's offsets, supports and features stand for the
 * scene's. False: no memory, and nothing is decided. */
bool saga_rate_decide(saga_rate *r, saga_scene *s, const saga_rate_input *x,
                      saga_error *error);

/* The scene is to be packed as this, with what the networks gave. */
typedef struct saga_rate_choice {
    saga_scene scene;            /* the trained one; its entropy networks and
                                  * model.sources are what is left of them */
    real *params;               /* of those networks */
    const saga_rate *rate;       /* plan, constants; batches of all blocks */
    double bits[SAGA_N_STEPS];   /* code lengths of the residuals, estimated */
} saga_rate_choice;

/* Makes the choice by the plan of r, which must outlive it. False: nothing is
 * to be freed. */
bool saga_rate_choice_init(saga_rate_choice *c, saga_rate *r,
                           const saga_rate_input *x, saga_error *error);
void saga_rate_choice_free(saga_rate_choice *c);

/* Adds to c->bits those of kinds first..last, in their order, x as for
 * saga_rate_code; sets their constants, and the batches of all their blocks. */
void saga_rate_choice_code(saga_rate_choice *c, saga_rate *r,
                           const saga_rate_input *x, int first, int last);

#endif
