/* SPDX-License-Identifier: MIT
 *
 * Adam for many small vectors ("blocks") of one kind, each in axes of
 * its own: those of its gradients' covariance.
 *
 * Adam divides each number's step by its gradient's size. Where the numbers of
 * a block pull together, as the features of one anchor do through F_geo, that
 * is the wrong scale in every direction but the axes: it is too long along a
 * steep valley's walls and too short along its floor. Turned into the axes
 * in which the gradients do not correlate, each direction gets its own scale.
 * (The idea is Shampoo's, in the form of SOAP: Adam in the eigenbasis of the
 * covariance.)
 */
#ifndef SAGA_BLOCK_ADAM_H
#define SAGA_BLOCK_ADAM_H

#include "adam.h"
#include "model.h"

/* Iterations between two turns of a block's axes. Blocks take turns, so that
 * each iteration turns some. A turn costs as much as some twenty steps of its
 * block; turns closer together (20) gained nothing in one pair. */
enum { SAGA_BLOCK_TURN_EVERY = 50 };

/* n blocks of `width` numbers, at most SAGA_MAX_FEATURES. All but the gradient
 * and the rate is state, the caller's. */
typedef struct saga_block_adam {
    real *x;                 /* (n, width) */
    const real *g;           /* (n, width) gradients */
    real *m, *v;             /* (n, width) moments along the axes; zero before
                              * the first step */
    real *covariance;        /* (n, width, width), zero before it */
    real *axes;              /* (n, width, width), rows are axes; see
                              * saga_block_adam_begin */
    size_t n, width;
    real rate;
} saga_block_adam;

#define saga_block_adam_begin SAGA_REAL_NAME(saga_block_adam_begin)
#define saga_block_adam_update SAGA_REAL_NAME(saga_block_adam_update)

/* Sets all axes to those of the coordinates. */
void saga_block_adam_begin(const saga_block_adam *b);

/* Does one step; it counts from 1. Until a block's first turn this is Adam's
 * step (adam.h), with the same bound on a gradient. All must be finite, which
 * saga_adam_update tells of. The same bits for any number of threads. */
void saga_block_adam_update(const saga_block_adam *b, const saga_adam *adam,
                            uint64_t step);

#endif
