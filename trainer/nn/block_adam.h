/* SPDX-License-Identifier: MIT
 *
 * Adam for many small vectors of the same kind ("blocks"), each along its own
 * axes, which are the eigenvectors of its gradients' covariance.
 *
 * Adam divides the step of each number by the size of its gradient. If the
 * gradients of a block are correlated, as those of an anchor's features are by
 * F_geo, this scale is wrong in every direction except the axes: too long
 * across a steep valley, too short along its floor. In axes along which the
 * gradients are uncorrelated, each direction gets its own scale. (The idea is
 * Shampoo's, in the form of SOAP: Adam in the eigenbasis of the covariance.)
 */
#ifndef SAGA_BLOCK_ADAM_H
#define SAGA_BLOCK_ADAM_H

#include "adam.h"
#include "model.h"

/* Iterations between two updates of a block's axes. In each iteration some of
 * the blocks are updated. An update costs as much as about twenty steps of its
 * block; updates every 20 iterations gained nothing in a paired comparison. */
enum {
    SAGA_BLOCK_TURN_EVERY = 50,
    SAGA_BLOCK_RECENT = 5 /* steps between two updates of a covariance */
};

/* The numbers of a row that a block has: first .. first + n - 1. */
typedef struct saga_block_span {
    uint8_t first, n;
} saga_block_span;

/* n blocks, each of the numbers of a row that `span` tells, or of all. `width`
 * is the largest number of a block rounded up to a multiple of four, and at
 * most SAGA_MAX_FEATURES. Everything except gradient, spans and rate is state,
 * owned by the caller. */
typedef struct saga_block_adam {
    real *x;                     /* (n, stride) */
    const real *g;               /* (n, stride) gradients */
    const saga_block_span *span; /* (n); NULL: all of a row, of `width` */
    real *m, *v;      /* (n, width) moments along the axes, zero before
                       * the first step */
    real *covariance; /* (n, width, width), zero before the first step */
    real *recent;     /* (n, SAGA_BLOCK_RECENT, width) gradients that the
                       * covariance has yet to get, zero before the first
                       * step */
    real *axes;       /* (n, width, width) rows are axes; set by
                       * saga_block_adam_begin */
    size_t n, width, stride;
    real rate;
} saga_block_adam;

#define saga_block_adam_begin SAGA_ISA_NAME(saga_block_adam_begin)
#define saga_block_adam_update SAGA_ISA_NAME(saga_block_adam_update)

/* Sets the axes of all blocks to those of the coordinates. */
extern void saga_block_adam_begin(const saga_block_adam *b);

/* Does a step; `step` counts from 1. Until the first update of its axes, a
 * block's step is that of adam.h, with the same limit of a gradient. All values
 * must be finite (saga_adam_update checks it). The result does not depend on
 * the number of threads. */
extern void saga_block_adam_update(const saga_block_adam *b,
                                   const saga_adam *adam, uint64_t step);

#endif
