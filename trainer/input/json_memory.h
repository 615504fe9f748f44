/* SPDX-License-Identifier: MIT
 *
 * Whether jansson got the memory it asked for. By itself it does not always
 * tell: a string becomes an invalid token, and a long number loses a digit and
 * is accepted.
 */
#ifndef SAGA_JSON_MEMORY_H
#define SAGA_JSON_MEMORY_H

#include <stdbool.h>

/* Begins to watch what jansson does in this thread. */
void saga_json_watch(void);
/* Whether some memory was refused since. */
bool saga_json_starved(void);

#endif
