/* SPDX-License-Identifier: MIT
 *
 * At its end `saga encode` says in words what is well represented and what is
 * not, and where a rolling shutter shows.
 */
#ifndef SAGA_VERDICT_CLI_H
#define SAGA_VERDICT_CLI_H

#include "shutter.h"
#include "verdict.h"

#include <jansson.h>

/* Prints the verdict, with what to try where it is bad: best says that no
 * preset is better. */
void saga_verdict_print(const saga_verdict *v, bool best);

/* Returns the numbers: {"still", "moving", "moving_as_still", "moving_share"};
 * null where there is no such pixel. */
json_t *saga_verdict_json(const saga_verdict *v);

/* Prints the views whose rows are read one after the other, if there are any;
 * found: (capture->n_views). */
void saga_shutter_print(const saga_shutter_found *found,
                        const saga_capture *capture);

/* Returns {NAME: {"frames", "standard_error", "shows"}, ..}; null where too
 * little moves. */
json_t *saga_shutter_json(const saga_shutter_found *found,
                          const saga_capture *capture);

#endif
