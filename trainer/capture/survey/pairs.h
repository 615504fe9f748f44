/* SPDX-License-Identifier: MIT
 *
 * The views of a capture are compared by pairs: features of each, and what
 * these have in common. Of many views only neighbours are compared.
 */
#ifndef SAGA_PAIRS_H
#define SAGA_PAIRS_H

#include "capture.h"
#include "matches.h"

/* A match is right where it lies that near to its line, at 960 pixels' width;
 * corners are found to half a pixel, and poses that COLMAP finds are good to
 * half a pixel. A camera turned by 0.3 degrees moves what it sees by two of 480
 * pixels. */
#define SAGA_MATCH_WITHIN 2.0

enum { SAGA_ALL_PAIRS = 24 };    /* views of which every two are compared */

/* Matches of views a and b, a < b. */
typedef struct saga_pair {
    int a, b;
    size_t n;
    saga_match *matches;     /* (n) */
} saga_pair;

typedef struct saga_pairs {
    const saga_capture *capture;
    int frame;               /* whose pictures are compared */
    saga_features *features; /* (n_views) */
    saga_pair *list;         /* (n) */
    size_t n;
    double within;           /* pixels, of these pictures */
} saga_pairs;

/* Finds the features of all views at a frame; the list is empty.
 * saga_pairs_free, also after a failure. */
bool saga_pairs_look(saga_pairs *pairs, const saga_capture *capture, int frame,
                     saga_error *error);

/* Lists which views are compared; it depends on the poses only. */
bool saga_pairs_list(saga_pairs *pairs, saga_error *error);

/* Finds the matches of a pair; matches has room for SAGA_FEATURES_MOST. Returns
 * how many. */
typedef size_t saga_pair_fn(saga_match *matches, const saga_pairs *pairs,
                            const saga_pair *pair);

/* This one keeps those that some two pinholes may have seen, whatever the poses
 * are; none where too few agree. */
size_t saga_pair_agree(saga_match *matches, const saga_pairs *pairs,
                       const saga_pair *pair);

/* Fills the matches of all pairs; those that have none are dropped from the
 * list. */
bool saga_pairs_match(saga_pairs *pairs, saga_pair_fn *match,
                      saga_error *error);

void saga_pairs_free(saga_pairs *pairs);

#endif
