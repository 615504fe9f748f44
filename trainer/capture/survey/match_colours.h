/* SPDX-License-Identifier: MIT
 *
 * Compares the colours of cameras at their matches, which both of two cameras
 * see.
 */
#ifndef SAGA_MATCH_COLOURS_H
#define SAGA_MATCH_COLOURS_H

#include "pairs.h"

/* What the matches of a view tell about its colours; NaN: it has too few. */
typedef struct saga_match_colour {
    double stops;   /* exposure relative to the others, as log2 of
                     * light */
    double colour;  /* median difference from the others once exposure
                     * is corrected, in 8-bit levels */
    double swapped; /* that difference with the view's red and blue
                     * exchanged, as a part of it */
} saga_match_colour;

/* Sets colours (n_views of the pairs' capture). */
bool saga_match_colours_find(saga_match_colour *colours,
                             const saga_pairs *pairs, saga_error *error);

#endif
