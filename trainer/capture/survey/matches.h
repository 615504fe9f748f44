/* SPDX-License-Identifier: MIT
 *
 * Matches are places that two pictures of one scene show both. Which of them
 * are right is found out without any calibration: points that two pinholes see
 * obey one fundamental matrix F, (b, 1)^T F (a, 1) = 0 (Hartley and Zisserman,
 * Multiple View Geometry, chapter 9), and wrong matches obey none.
 */
#ifndef SAGA_MATCHES_H
#define SAGA_MATCHES_H

#include "corners.h"

#include <stdbool.h>

typedef struct saga_match {
    double a[2], b[2];       /* pixels of the two pictures */
    double doubt;            /* how near the second best was: 0 sure, 1 not */
    int of_a, of_b;          /* which of the features they are */
} saga_match;

/* Returns how alike two features look: the cosine of their descriptions. */
double saga_feature_likeness(const saga_feature *a, const saga_feature *b);

/* Only such features may match. */
typedef struct saga_match_rule {
    bool (*may)(const void *user, const saga_feature *a,
                const saga_feature *b);
    const void *user;
    double alike;            /* cosine of their descriptions at least: where
                              * few may match, the best has few rivals */
} saga_match_rule;

/* Finds features that are each other's nearest, by far; matches has room for
 * SAGA_FEATURES_MOST; rule NULL: all may match. Returns how many, the surest
 * first. */
size_t saga_matches_find(saga_match *matches, const saga_features *a,
                         const saga_features *b, const saga_match_rule *rule);

/* Moves the matches to the front that obey one fundamental matrix within
 * `within` pixels, and returns how many: 0 where chance may have done it. The
 * same seed gives the same ones. */
size_t saga_matches_agree(saga_match *matches, size_t n, double within,
                          uint64_t seed);

#endif
