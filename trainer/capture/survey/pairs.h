/* SPDX-License-Identifier: MIT
 *
 * Compares the views of a capture in pairs: finds the features of each, and the
 * matches of each pair. If there are many views, only neighbours are compared.
 */
#ifndef SAGA_PAIRS_H
#define SAGA_PAIRS_H

#include "capture.h"
#include "matches.h"

/* A match is right if it is within this distance, in pixels of a picture of 960
 * pixels' width, from its epipolar line. Corners are accurate to half a pixel,
 * and so are poses that COLMAP finds. A camera rotated by 0.3 degrees moves its
 * picture by two of 480 pixels. */
#define SAGA_MATCH_WITHIN 2.0

enum {
    SAGA_ALL_PAIRS = 24
}; /* up to this number of views, all pairs are
    * compared */

/* Matches of views a and b, a < b. */
typedef struct saga_pair {
    int a, b;
    size_t n;
    saga_match *matches; /* (n) */
} saga_pair;

typedef struct saga_pairs {
    const saga_capture *capture;
    int frame;               /* frame whose pictures are compared */
    saga_features *features; /* (n_views) */
    saga_pair *list;         /* (n) */
    size_t n;
    double within; /* SAGA_MATCH_WITHIN in pixels of these pictures */
} saga_pairs;

/* Finds the features of all views at a frame, without pairs. saga_pairs_free
 * must be called also after a failure. */
bool saga_pairs_look(saga_pairs *pairs, const saga_capture *capture, int frame,
                     saga_error *error);

/* Lists the pairs of views to compare, which depends only on the poses. */
bool saga_pairs_list(saga_pairs *pairs, saga_error *error);

/* A function that finds the matches of a pair. matches has room for
 * SAGA_FEATURES_MOST. Returns their number. */
typedef size_t saga_pair_fn(saga_match *matches, const saga_pairs *pairs,
                            const saga_pair *pair);

/* Keeps the matches that two pinholes in any poses could have seen; none if too
 * few agree. */
size_t saga_pair_agree(saga_match *matches, const saga_pairs *pairs,
                       const saga_pair *pair);

/* Sets the matches of all pairs. Pairs without matches are removed from the
 * list. */
bool saga_pairs_match(saga_pairs *pairs, saga_pair_fn *match,
                      saga_error *error);

void saga_pairs_free(saga_pairs *pairs);

#endif
