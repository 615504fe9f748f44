/* SPDX-License-Identifier: MIT
 *
 * Valid streams that take branches of docs/arithmetic.md which trained and
 * random files never take. tests/stream/extremes.py lists the branches.
 */
#ifndef GEN_EXTREME_H
#define GEN_EXTREME_H

#include "gen_stream.h"

/* A picture of a stream: its time, 0..65535, and a camera of the rig. */
typedef struct gen_look {
    int32_t t;
    uint32_t camera;
} gen_look;

enum { GEN_MAX_LOOKS = 3 };

typedef struct gen_extreme_plan {
    const char *name;
    gen_look look[GEN_MAX_LOOKS];
    int n_looks; /* beside those of every stream */
} gen_extreme_plan;

/* Makes stream number i (free it) and sets *plan to its name and pictures.
 * Returns 0 if there are not as many. */
int gen_extreme(gen_stream *g, int i, gen_extreme_plan *plan);

#endif
