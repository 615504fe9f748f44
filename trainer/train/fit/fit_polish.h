/* SPDX-License-Identifier: MIT
 *
 * Polishing moves coded features by whole steps once training is over, where
 * that lowers the loss. Training rounds them straight through: a feature whose
 * best value lies between two steps goes to and fro between these, and stays
 * where the last iterations left it. Here all pictures are looked at before
 * anything is moved. Moving a feature by a step s up or down changes the loss
 * by
 *
 *     +-s g + s^2 h / 2 + price (R' - R),
 *
 * where g is the gradient of all pictures' squared error, h the diagonal of its
 * Gauss-Newton matrix, and R what the feature takes by the entropy model. Turns
 * follow each other; one after which the loss is not less is taken back.
 */
#ifndef SAGA_FIT_POLISH_H
#define SAGA_FIT_POLISH_H

#include "fit.h"

/* It tells what came of it, in units of the loss. */
typedef struct saga_fit_polished {
    int n_turns;                 /* 0: nothing was moved */
    double before, after;        /* D + price R as the file decodes */
    double foretold;             /* what the turns that were kept should have
                                  * gained */
} saga_fit_polished;

/* Moves the features of a fit whose iterations are over, if they have visited
 * every picture four times; it takes about as long as four to six visits of
 * each. A scene in layers stays as it is: what is better for all of it may be
 * worse for the first ones. So does one with given networks, whose formats were
 * not measured for what would move. Only saga_fit_code and this may follow.
 * Fails where memory is short. */
bool saga_fit_polish(saga_fit *fit, saga_fit_polished *polished,
                     saga_error *error);

#endif
