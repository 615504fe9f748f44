/* SPDX-License-Identifier: MIT
 *
 * A sweep makes a curve of files: the same capture with increasing numbers of
 * primitives, each with the price of a bit that the rule gives for that number
 * (policy.h). These points are on the hull of the rate-distortion points
 * (docs/lab/size.md).
 *
 * The folder gets N.saga and N.json for each file, the smallest first, and
 * curve.json with the results of the files for which no smaller file is better.
 * Existing results are kept, so that a sweep that was stopped can continue.
 */
#ifndef SAGA_SWEEP_H
#define SAGA_SWEEP_H

#include "cli.h"

#include <jansson.h>

/* A curve needs four points; the fifth is a reserve if one is off the hull. The
 * numbers of primitives of neighbours differ by a factor of sqrt(3). */
enum { SAGA_SWEEP_N = 5 };
#define SAGA_SWEEP_STEP 1.7320508075688772

typedef struct saga_sweep {
    const char *folder;
    bool resume; /* the folder may hold results of a sweep that was stopped */
    bool json;   /* print JSON */
    const json_t *options; /* every result must have been made with these:
                            * result.encode.options */
    /* Makes and evaluates a file with the fraction `part` of the largest number
     * of primitives, and writes its result, an `eval` report with "encode" in
     * it. Returns the exit status. */
    int (*make)(void *user, const char *file, const char *result, double part);
    void *user;
} saga_sweep;

/* Makes all files and the curve. Returns the exit status, after a message if it
 * is not 0. */
int saga_sweep_run(const saga_sweep *s);

#endif
