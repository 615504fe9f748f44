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

/* Finds the neighbours of a position: the at most K nearest candidates with
 * d < rho^2. Candidates are the anchors of the tier with ranks from centre - w
 * to centre + w.
 * To interpolate features, `before` is SAGA_ALL_GROUPS, and `centre`, the
 * parent of the position, is always among the neighbours; with K = 1 it is the
 * only neighbour, and its d is set to 0. To predict symbols, only anchors of
 * the groups below `before`, which are decoded already, are candidates, and
 * nb->n may be 0. */
void saga_interp_find(saga_neighbours *nb, const saga_scaffold *sc, int tier,
                      const saga_position *query, uint32_t centre,
                      uint32_t before);

/* Sets out[0..F) to the weighted sum of features, rounded once, or to 0 if
 * nb->n is 0. */
void saga_interp_sum(int16_t *out, const saga_scaffold *sc, int tier,
                     const saga_neighbours *nb);

#endif
