/* SPDX-License-Identifier: MIT
 *
 * A sweep makes a curve of files: the same capture with ever more primitives,
 * each at the price of a bit that the rule gives for them (policy.h); that is
 * on the hull (docs/lab/size.md).
 *
 * The folder gets N.saga and N.json for each, the smallest first, and
 * curve.json, the results of those that no other is better than and smaller.
 * What is there is not made again: a sweep that was stopped goes on.
 */
#ifndef SAGA_SWEEP_H
#define SAGA_SWEEP_H

#include "cli.h"

#include <jansson.h>

/* A curve wants four points; the fifth is there where one is off the hull. The
 * primitives of neighbours differ by a factor of sqrt(3). */
enum { SAGA_SWEEP_N = 5 };
#define SAGA_SWEEP_STEP 1.7320508075688772

typedef struct saga_sweep {
    const char *folder;
    bool resume;             /* the folder may hold what is left of one */
    bool json;               /* is what is printed */
    const json_t *options;   /* that every result must have been made with:
                              * result.encode.options */
    /* Makes and judges a file with `part` of the most primitives, writes the
     * result, an `eval` report with "encode" in it. The exit status. */
    int (*make)(void *user, const char *file, const char *result, double part);
    void *user;
} saga_sweep;

/* The exit status; messages are told. */
int saga_sweep_run(const saga_sweep *s);

#endif
