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

enum {
    /* Iterations between two updates of a block's axes. In each iteration some
     * of the blocks are updated. An update costs as much as about twenty steps
     * of its block; updates every 20 iterations gained nothing in a paired
     * comparison. */
    SAGA_BLOCK_TURN_EVERY = 50,
    SAGA_BLOCK_RECENT = 5, /* steps between two updates of a covariance */
    SAGA_BLOCK_LANES = 16  /* blocks that are computed together */
};

/* The numbers of a row that a block has: first .. first + n - 1. */
typedef struct saga_block_span {
    uint8_t first, n;
} saga_block_span;

/* n blocks, each of the numbers of a row that `span` tells, or of all. `width`
 * is the largest number of a block rounded up to a multiple of four, and at
 * most SAGA_MAX_FEATURES. The state has saga_block_adam_size reals. Of each
 * group of blocks it has axes (width, width), whose rows are axes; the moments
 * m and v (width) along them; the covariance (width, width) of the gradients;
 * and gradients (SAGA_BLOCK_RECENT, width) that it has yet to get. Each of
 * these numbers is there SAGA_BLOCK_LANES times, once for each block of the
 * group; block 0 is the first of its group. */
typedef struct saga_block_adam {
    real *x;                     /* (n, stride) */
    const real *g;               /* (n, stride) gradients */
    const saga_block_span *span; /* (n); NULL: all of a row, of `width` */
    real *state;
    size_t n, width, stride;
    real rate;
} saga_block_adam;

#define saga_block_adam_size SAGA_ISA_NAME(saga_block_adam_size)
#define saga_block_adam_begin SAGA_ISA_NAME(saga_block_adam_begin)
#define saga_block_adam_update SAGA_ISA_NAME(saga_block_adam_update)

/* Returns the number of reals in the state of n blocks. */
extern size_t saga_block_adam_size(size_t n, size_t width);

/* Sets the axes of all blocks to those of the coordinates, and all other state
 * to zero. */
extern void saga_block_adam_begin(const saga_block_adam *b);

/* Does a step; `step` counts from 1. Until the first update of its axes, a
 * block's step is that of adam.h, with the same limit of a gradient. All values
 * must be finite (saga_adam_update checks it). The result does not depend on
 * the number of threads. */
extern void saga_block_adam_update(const saga_block_adam *b,
                                   const saga_adam *adam, uint64_t step);

#endif
