/* SPDX-License-Identifier: MIT
 *
 * Counts work while it is done, so that whoever waits for it is asked now and
 * then whether to go on. A unit is one multiply-accumulate; what is no
 * network's is counted by what it is worth, roughly.
 */
#ifndef SAGA_TALLY_H
#define SAGA_TALLY_H

#include <stdint.h>

enum {
    SAGA_TALLY_EVERY = 1 << 20,  /* units between two questions; a run more */
    SAGA_TALLY_SYMBOL = 64       /* units of an entropy-coded symbol */
};

typedef struct saga_tally {
    int (*stop)(void *user);     /* not 0: stop; NULL: nobody is asked */
    void *user;
    uint32_t done;               /* units since it was asked */
    int stopped;                 /* the answer; stays when it is not 0 */
} saga_tally;

/* Adds at most 2^31 units. Returns 1 once there is a reason to stop; a tally
 * that is NULL never has one. */
int saga_tally_add(saga_tally *m, uint32_t units);

#endif
