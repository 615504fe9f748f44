/* SPDX-License-Identifier: MIT
 *
 * A sweep makes a curve of files: the same capture with increasing numbers of
 * primitives, each with the price of a bit that the rule gives for that number
 * (policy.h). These points are on the hull of the rate-distortion points
 * (docs/lab/size.md).
 *
 * The largest file is trained first. Each other one begins with what the next
 * larger one has learned, which saves some of its time.
 *
 * The folder gets N.saga and N.json for each file, the smallest with number 1,
 * and curve.json with the results of the files for which no smaller file is
 * better. Existing results are kept, so that a sweep that was stopped can
 * continue.
 */
#ifndef SAGA_SWEEP_H
#define SAGA_SWEEP_H

#include "cli.h"

#include <jansson.h>

/* A curve needs four points; the fifth is a reserve if one is off the hull. The
 * numbers of primitives of neighbours differ by a factor of sqrt(3). */
enum { SAGA_SWEEP_N = 5 };
#define SAGA_SWEEP_STEP 1.7320508075688772

/* One file of a sweep. */
typedef struct saga_sweep_file {
    const char *file, *result; /* paths */
    double part;               /* of the largest number of primitives */
    const char *above; /* NULL, or the checkpoint of the next larger file, which
                        * this one begins with */
    double shorter;    /* then the part of the rendering stage that it needs */
} saga_sweep_file;

typedef struct saga_sweep {
    const char *folder;
    bool resume; /* the folder may hold results of a sweep that was stopped */
    bool json;   /* print JSON */
    const json_t *options; /* every result must have been made with these:
                            * result.encode.options */
    /* Makes and evaluates a file, and writes its result, an `eval` report with
     * "encode" in it. Keeps the checkpoint, FILE.ckpt. Returns the exit
     * status. */
    int (*make)(void *user, const saga_sweep_file *file);
    void *user;
} saga_sweep;

/* Makes all files and the curve. Returns the exit status, after a message if it
 * is not 0. */
int saga_sweep_run(const saga_sweep *s);

#endif
