/* SPDX-License-Identifier: MIT
 *
 * Poses and lenses are refined by bundle adjustment over matches. A fifth of
 * the places is kept apart and decides whether that was an improvement.
 */
#ifndef SAGA_REFINE_H
#define SAGA_REFINE_H

#include "pairs.h"

#include "epipolar.h"

typedef struct saga_refinement {
    bool helps;              /* the matches kept apart fit clearly better */
    double before, after;    /* pixels that these are off their lines, the
                              * median; NaN: too few */
    saga_pinhole *cameras;   /* (n_views) refined; NULL: none */
} saga_refinement;

/* Fills *refinement from the matches of all pairs; free(cameras) also after a
 * failure. */
bool saga_refine(saga_refinement *refinement, const saga_pairs *pairs,
                 saga_error *error);

#endif
