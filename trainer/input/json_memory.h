/* SPDX-License-Identifier: MIT
 *
 * jansson does not say whether it got the memory it asked for; this does. By
 * itself it does not always tell: a string becomes an invalid token, and a long
 * number loses a digit and is accepted.
 */
#ifndef SAGA_JSON_MEMORY_H
#define SAGA_JSON_MEMORY_H

#include "error.h"

#include <jansson.h>
#include <stdbool.h>

/* Begins to watch what jansson does in this thread. */
void saga_json_watch(void);
/* Tells whether some memory was refused since. */
bool saga_json_starved(void);


/* Reads a file whose root is an object; json_decref it. NULL with the error:
 * where memory ended, where it is no JSON, and in which line. */
json_t *saga_json_read(const char *path, saga_error *error);

#endif
