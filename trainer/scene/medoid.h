/* SPDX-License-Identifier: MIT
 *
 * A leaf is divided: a few of its members become medoids, the rest goes to near
 * ones that have room. Paper: Initialization and Optimization.
 */
#ifndef SAGA_MEDOID_H
#define SAGA_MEDOID_H

#include "symbols.h"

#include <stdint.h>

enum { SAGA_MEDOID_MOST = SAGA_MAX_CHILDREN * SAGA_MAX_CHILDREN };

typedef struct saga_medoid_division {
    const double *distance;          /* (n, n) >= 0, symmetric; the caller's */
    uint32_t n;                      /* members, 1..SAGA_MEDOID_MOST */
    uint32_t k;                      /* medoids, 1..min(n, SAGA_MAX_CHILDREN) */
    double w[SAGA_MEDOID_MOST];      /* weights of the members, > 0 */
    uint32_t medoid[SAGA_MAX_CHILDREN]; /* result: their members */
    uint8_t of[SAGA_MEDOID_MOST];    /* result: each member's medoid, 0..k-1 */
} saga_medoid_division;

/* Finds medoid and of from distance, n, k and w. No medoid has more than `room`
 * members, itself among them. k * room >= n. */
void saga_medoid_divide(saga_medoid_division *v, uint32_t room);

#endif
