/* SPDX-License-Identifier: MIT
 *
 * Refines poses and lenses by bundle adjustment over matches. A fifth of the
 * places is not used for this and tests whether the result is better.
 */
#ifndef SAGA_REFINE_H
#define SAGA_REFINE_H

#include "tracks.h"

typedef struct saga_refinement {
    bool helps;            /* the test matches fit clearly better */
    double before, after;  /* median error of the test matches in pixels; NaN:
                            * too few */
    saga_pinhole *cameras; /* (n_views) refined cameras; NULL: none */
    double *moved;         /* (n_views) median distance in pixels by which a
                            * camera sees the places elsewhere than before;
                            * NaN: it sees too few. NULL: none */
} saga_refinement;

/* Refines the cameras by the tracks of the pairs' matches. The caller frees
 * *refinement by saga_refinement_free, also after a failure. */
bool saga_refine(saga_refinement *refinement, const saga_pairs *pairs,
                 const saga_tracks *tracks, saga_error *error);
void saga_refinement_free(saga_refinement *refinement);

#endif
