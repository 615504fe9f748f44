/* SPDX-License-Identifier: MIT
 *
 * Valid streams that take branches of docs/arithmetic.md which trained and
 * random files never take. tests/check_coverage.py lists the branches.
 */
#ifndef GEN_EXTREME_H
#define GEN_EXTREME_H

#include "gen_stream.h"

/* Makes stream number i (free it) and sets *name to its name. Returns 0 if
 * there are not as many. */
int gen_extreme(gen_stream *g, int i, const char **name);

#endif
