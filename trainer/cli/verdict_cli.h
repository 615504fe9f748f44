/* SPDX-License-Identifier: MIT
 *
 * At its end `saga encode` says in words what is well represented and what is
 * not.
 */
#ifndef SAGA_VERDICT_CLI_H
#define SAGA_VERDICT_CLI_H

#include "verdict.h"

#include <jansson.h>

/* Prints the verdict, with what to try where it is bad: best says that no
 * preset is better. */
void saga_verdict_print(const saga_verdict *v, bool best);

/* Returns the numbers: {"still", "moving", "moving_as_still", "moving_share"};
 * null where there is no such pixel. */
json_t *saga_verdict_json(const saga_verdict *v);

#endif
