/* SPDX-License-Identifier: MIT
 *
 * Divides a leaf: some of its members become medoids, and each other member
 * goes to a near one that has room. Paper: Initialization and Optimization.
 */
#ifndef SAGA_MEDOID_H
#define SAGA_MEDOID_H

#include "symbols.h"

#include <stdint.h>

enum { SAGA_MEDOID_MOST = SAGA_MAX_CHILDREN * SAGA_MAX_CHILDREN };

typedef struct saga_medoid_division {
    const double *distance;     /* (n, n) between members: >= 0, symmetric;
                                 * owned by the caller */
    uint32_t n;                 /* number of members,
                                 * 1..SAGA_MEDOID_MOST */
    uint32_t k;                 /* number of medoids, 1..min(n,
                                 * SAGA_MAX_CHILDREN) */
    double w[SAGA_MEDOID_MOST]; /* weights of the members, > 0 */
    uint32_t medoid[SAGA_MAX_CHILDREN]; /* result: index of the member that is
                                         * each medoid */
    uint8_t of[SAGA_MEDOID_MOST]; /* result: medoid of each member, 0..k-1 */
} saga_medoid_division;

/* Sets medoid and of from distance, n, k and w. A medoid has at most `room`
 * members, including itself; k * room >= n. */
void saga_medoid_divide(saga_medoid_division *v, uint32_t room);

#endif
