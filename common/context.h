/* SPDX-License-Identifier: MIT
 *
 * Entropy parameters (mu, scale index) of a block of residuals from what is
 * already decoded: INR hyperprior, parent, earlier groups. Paper: Hierarchical
 * Context Modeling, E_phi.
 */
#ifndef SAGA_CONTEXT_H
#define SAGA_CONTEXT_H

#include "scaffold.h"

/* Parameters of one block: mu in the Q of the coded value, scale indices of
 * the residual coder. */
typedef struct saga_params {
    int16_t mu[4 + SAGA_MAX_FEATURES];
    uint8_t scale[4 + SAGA_MAX_FEATURES];
} saga_params;

/* Coarse anchor `rank` of group `group`: channels centre 4, features F. */
void saga_context_coarse(saga_params *p, const saga_scaffold *sc,
                         uint32_t rank, uint32_t group);

/* Fine anchor `rank` of group `group`, whose x, t are its suffix cell's
 * centre: channels offset 4. */
void saga_context_fine(saga_params *p, const saga_scaffold *sc, uint32_t rank,
                       uint32_t group);

/* The primitives of fine anchor `rank`: channels offset 4, for all alike. */
void saga_context_prim(saga_params *p, const saga_scaffold *sc, uint32_t rank);

#endif
