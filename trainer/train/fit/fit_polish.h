/* SPDX-License-Identifier: MIT
 *
 * Polishing moves coded features by whole steps once training is over, where
 * that lowers the loss. Training rounds features and passes gradients through
 * as if it did not; a feature whose best value lies between two steps
 * oscillates between them, and ends wherever the last iterations left it.
 * Polishing evaluates all pictures, or a part of those of a long film, before
 * it moves anything. Moving a feature by one step s, up or down, changes the
 * loss by
 *
 *     +-s g + s^2 h / 2 + price (R' - R),
 *
 * where g is the gradient of the squared error over these pictures, h the
 * diagonal of its Gauss-Newton matrix, and R the bits of the feature by the
 * entropy model. It works in several turns; a turn that does not lower the loss
 * is undone.
 */
#ifndef SAGA_FIT_POLISH_H
#define SAGA_FIT_POLISH_H

#include "fit.h"

/* The result of a polish, in units of the loss. */
typedef struct saga_fit_polished {
    int n_turns;          /* turns taken; 0: nothing was moved */
    double before, after; /* D + price R of the decoded scene */
    double foretold;      /* the gain predicted for the turns that were
                           * kept */
} saga_fit_polished;

/* Polishes the features of a fit after its last iteration, if it has visited
 * every picture at least four times. That draws four to six times as many
 * pictures as there are, and at most three eighths of the stage's. A scene with
 * several layers is left as it is, since a move that helps all layers together
 * may harm the first ones; so is a scene with given networks, whose number
 * formats were not measured for moved features. Only saga_fit_code and this
 * function may follow. Returns false with *error set if memory is short. */
bool saga_fit_polish(saga_fit *fit, saga_fit_polished *polished,
                     saga_error *error);

/* Returns how many pictures the polish draws after n_render iterations on
 * n_there pictures, unless the scene is left as it is. */
int saga_fit_polish_draws(int n_render, int n_there);

#endif
