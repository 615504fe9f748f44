/* SPDX-License-Identifier: MIT
 *
 * Counts work while it is done, and regularly calls a function of the caller,
 * which may stop it. A unit is one multiply-accumulate; work outside the
 * networks is counted by its approximate time.
 */
#ifndef SAGA_TALLY_H
#define SAGA_TALLY_H

#include <stdint.h>

enum {
    SAGA_TALLY_EVERY = 1 << 20, /* units between two calls, plus at most a run
                                 * of a network */
    SAGA_TALLY_SYMBOL = 64      /* units of an entropy-coded symbol */
};

typedef struct saga_tally {
    int (*stop)(void *user); /* returns other than 0 to stop; may be NULL */
    void *user;
    uint32_t done; /* units since the last call */
    int stopped;   /* last result of stop; kept once not 0 */
} saga_tally;

/* Adds at most 2^31 units. Returns 1 if the caller wants to stop, now or
 * earlier; 0 if m is NULL. */
int saga_tally_add(saga_tally *m, uint32_t units);

#endif
