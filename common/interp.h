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

/* Finds the neighbours of a position. Candidates are the ranks centre - w ..
 * centre + w of the tier that exist. Members are the at most K nearest with
 * d < rho^2. With before = SAGA_ALL_GROUPS the anchor `centre`, the parent of
 * the position, is always a member. Otherwise only anchors of groups < before
 * are candidates, and there may be no member. */
void saga_interp_find(saga_neighbours *nb, const saga_scaffold *sc, int tier,
                      const saga_position *query, uint32_t centre,
                      uint32_t before);

/* Sets out[0..F) to the weighted sum of features, rounded once, or to 0 if
 * nb->n is 0. */
void saga_interp_sum(int16_t *out, const saga_scaffold *sc, int tier,
                     const saga_neighbours *nb);

#endif
