/* SPDX-License-Identifier: MIT
 *
 * Predicts the entropy parameters (mu, scale index) of a block of residuals
 * from decoded values: INR hyperprior, parent, earlier groups, bank; and adds
 * decoded blocks to the bank. Paper: Hierarchical Context Modeling, E_phi.
 */
#ifndef SAGA_CONTEXT_H
#define SAGA_CONTEXT_H

#include "scaffold.h"

/* A run is several blocks that depend on the same decoded values and pass
 * through the networks together, with their parameters: mu in the Q of the
 * coded value, and scale indices of the residual coder. Those of block i begin
 * at i * stride, which is 0 if all blocks have the same. mu and scale index are
 * one half each of the output vector of an entropy network. */
typedef struct saga_run {
    uint32_t n;
    uint32_t stride;
    uint32_t rank[SAGA_MAX_POINTS];
    int16_t mu[SAGA_MAX_VECTOR / 2];
    uint8_t scale[SAGA_MAX_VECTOR / 2];
} saga_run;

/* Sets the bank to its start state S_0 and computes the slots' own vectors.
 * Called before the first block of a layer. */
void saga_context_begin(const saga_scaffold *sc);

/* Makes the next run of a SAGA_KIND_*: blocks of group `group`, starting at
 * `rank`, as many as fit in the vectors and in the round of the bank. Returns
 * the rank at which the next run starts. A block and its channels are:
 *   coarse: an anchor; 4 of the centre, F features.
 *   fine:   an anchor, whose x, t are the centre of its suffix cell; 4 of the
 *           offset.
 *   prim:   the primitives of a fine anchor; 4 of the offset, shared by all.
 *           All are in group 0. */
uint32_t saga_context_run(saga_run *run, const saga_scaffold *sc, int kind,
                          uint32_t rank, uint32_t group);

/* Adds a decoded run of coarse or fine anchors to its round of the bank. The
 * round is written when it has bank_blocks blocks. Does nothing without a bank,
 * or if no block reads what this tier writes. */
void saga_context_keep(const saga_scaffold *sc, int tier, const saga_run *run);

/* Writes the last round of a group, even if it is not full. Called after the
 * last anchor of the group. */
void saga_context_end_group(const saga_scaffold *sc);

#endif
