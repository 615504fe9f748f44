/* SPDX-License-Identifier: MIT
 *
 * Entropy parameters (mu, scale index) of a block of residuals from what is
 * already decoded: INR hyperprior, parent, earlier groups, memory; and what is
 * decoded goes into the memory. Paper: Hierarchical Context Modeling, E_phi.
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

/* Before the first block of a segment: the memory's state S_0 and what its
 * networks make of the slots' numbers. */
void saga_context_begin(const saga_scaffold *sc);

/* Coarse anchor `rank` of group `group`: channels centre 4, features F. */
void saga_context_coarse(saga_params *p, const saga_scaffold *sc,
                         uint32_t rank, uint32_t group);

/* Fine anchor `rank` of group `group`, whose x, t are its suffix cell's
 * centre: channels offset 4. */
void saga_context_fine(saga_params *p, const saga_scaffold *sc, uint32_t rank,
                       uint32_t group);

/* The primitives of fine anchor `rank`: channels offset 4, for all alike. */
void saga_context_prim(saga_params *p, const saga_scaffold *sc, uint32_t rank);

/* Classes, 0..7, of symbols of a SAGA_CLASS_* kind (the number, or the four
 * axes of the set) at the given rank: coarse for N_FINE and FINE_SET, fine for
 * N_PRIM, of group `group`, whose x, t are decoded, and PRIM_SET. Returns 0,
 * and does nothing, if the kind has no source. */
int saga_context_classes(uint8_t class[4], const saga_scaffold *sc, int kind,
                         uint32_t rank, uint32_t group);

/* After a coarse (fine) anchor is decoded: adds it to its step of the memory,
 * which writes when it has memory_blocks blocks. Without a memory, or if no
 * one reads what this level writes, these do nothing. */
void saga_context_keep_coarse(const saga_scaffold *sc, uint32_t rank);
void saga_context_keep_fine(const saga_scaffold *sc, uint32_t rank);

/* After the last anchor of a group: its last step writes, however short. */
void saga_context_end_group(const saga_scaffold *sc);

#endif
