/* SPDX-License-Identifier: MIT
 *
 * Entropy parameters (mu, scale index) of a block of residuals from what is
 * already decoded: INR hyperprior, parent, earlier groups, bank; and what is
 * decoded goes into the bank. Paper: Hierarchical Context Modeling, E_phi.
 */
#ifndef SAGA_CONTEXT_H
#define SAGA_CONTEXT_H

#include "scaffold.h"

/* A run is of blocks that know the same and go through the networks together,
 * and of their parameters: mu in the Q of the coded value, scale indices of the
 * residual coder. Block i's begin at i * saga_n_channels; an entropy network
 * gives both for each channel, so half of its vector holds either. */
typedef struct saga_run {
    uint32_t n;
    uint32_t rank[SAGA_MAX_POINTS];
    int16_t mu[SAGA_MAX_VECTOR / 2];
    uint8_t scale[SAGA_MAX_VECTOR / 2];
} saga_run;

/* Before the first block of a segment this gives the bank's state S_0 and
 * what its networks make of the slots' numbers. */
void saga_context_begin(const saga_scaffold *sc);

/* Makes the next run of a SAGA_KIND_*: blocks of group `group` from `rank` on,
 * as many as the vectors hold and the bank's round has room for. Returns the
 * rank to go on from.
 *   coarse: an anchor; channels centre 4, features F.
 *   fine:   an anchor, whose x, t are its suffix cell's centre; offset 4.
 *   prim:   the primitives of a fine anchor; offset 4, for all alike. Group 0
 *           has them all. */
uint32_t saga_context_run(saga_run *run, const saga_scaffold *sc, int kind,
                          uint32_t rank, uint32_t group);

/* After a run of coarse (fine) anchors is decoded, this adds them to their
 * round of the bank, which writes when it has bank_blocks blocks. Without a
 * bank, or if no one reads what this tier writes, it does nothing. */
void saga_context_keep(const saga_scaffold *sc, int tier,
                       const saga_run *run);

/* After the last anchor of a group, its last round writes, however short. */
void saga_context_end_group(const saga_scaffold *sc);

#endif
