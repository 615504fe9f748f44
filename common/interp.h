/* SPDX-License-Identifier: MIT
 *
 * Kernel interpolation of anchor features (paper: Kernel Interpolation): the
 * nearest K of the candidates in a window of ranks, softmax of the negative
 * scale-normalised distance.
 */
#ifndef SAGA_INTERP_H
#define SAGA_INTERP_H

#include "scaffold.h"

/* Neighbours, nearest first by (d, rank); weights in Q14. */
typedef struct saga_neighbours {
    uint32_t n;
    uint32_t rank[SAGA_MAX_NEIGHBOURS];
    uint16_t d_q12[SAGA_MAX_NEIGHBOURS];
    uint16_t weight_q14[SAGA_MAX_NEIGHBOURS];
} saga_neighbours;

enum { SAGA_ALL_GROUPS = SAGA_MAX_GROUPS };

/* Candidates are ranks centre - w .. centre + w of the tier, cut at its ends;
 * members those with d < rho^2, at most K. With before = SAGA_ALL_GROUPS the
 * anchor `centre` is always a member (it is the query's parent); otherwise
 * only anchors of groups < before are candidates, and there may be none. */
void saga_interp_find(saga_neighbours *nb, const saga_scaffold *sc, int tier,
                      const saga_position *query, uint32_t centre,
                      uint32_t before);

/* out[0..F) = sum of weighted features, rounded once; zeros if nb->n is 0. */
void saga_interp_sum(int16_t *out, const saga_scaffold *sc, int tier,
                     const saga_neighbours *nb);

#endif
