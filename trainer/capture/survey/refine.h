/* SPDX-License-Identifier: MIT
 *
 * Refines poses and lenses by bundle adjustment over matches. A fifth of the
 * places is not used for this and tests whether the result is better.
 */
#ifndef SAGA_REFINE_H
#define SAGA_REFINE_H

#include "pairs.h"

#include "epipolar.h"

typedef struct saga_refinement {
    bool helps;              /* the test matches fit clearly better */
    double before, after;    /* median error of the test matches in pixels; NaN:
                              * too few */
    saga_pinhole *cameras;   /* (n_views) refined cameras; NULL: none */
} saga_refinement;

/* Refines the cameras by the matches of all pairs. The caller frees
 * refinement->cameras by free(), also after a failure. */
bool saga_refine(saga_refinement *refinement, const saga_pairs *pairs,
                 saga_error *error);

#endif
