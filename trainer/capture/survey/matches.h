/* SPDX-License-Identifier: MIT
 *
 * Matches are places that two pictures of a scene both show. Which of them are
 * right is decided without any calibration: points that two pinholes see obey
 * one fundamental matrix F, (b, 1)^T F (a, 1) = 0 (Hartley and Zisserman,
 * Multiple View Geometry, chapter 9), which wrong matches do not obey.
 */
#ifndef SAGA_MATCHES_H
#define SAGA_MATCHES_H

#include "corners.h"

#include <stdbool.h>

typedef struct saga_match {
    double a[2], b[2]; /* pixels in the two pictures */
    double doubt;      /* distance relative to the second-best match: 0:
                        * certain, 1: not */
    int of_a, of_b;    /* indices of the two features */
} saga_match;

/* A restriction on which features may match. */
typedef struct saga_match_rule {
    bool (*may)(const void *user, const saga_feature *a, const saga_feature *b);
    const void *user;
    double alike; /* least cosine of their descriptors, used if few
                   * features may match, so that the best has few
                   * rivals */
} saga_match_rule;

/* Finds features that are clearly each other's nearest. matches has room for
 * SAGA_FEATURES_MOST. If rule is NULL, all features may match. Returns the
 * number of matches; the most certain come first. */
size_t saga_matches_find(saga_match *matches, const saga_features *a,
                         const saga_features *b, const saga_match_rule *rule);

/* Moves the matches that obey one fundamental matrix within `within` pixels to
 * the front, and returns their number; 0 if chance may explain them. The same
 * seed gives the same result. */
size_t saga_matches_agree(saga_match *matches, size_t n, double within,
                          uint64_t seed);

#endif
