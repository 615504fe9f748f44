/* SPDX-License-Identifier: MIT
 *
 * jansson does not say whether it got the memory it asked for; this does. By
 * itself it does not always tell: a string becomes an invalid token, and a long
 * number loses a digit and is accepted. Nor does a list tell later that one of
 * its values was none, text that is no UTF-8 or a number that is not finite.
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
/* Tells whether one of the functions below failed since: something is missing.
 */
bool saga_json_lost(void);

/* These do what jansson's json_object_set_new_nocheck, json_array_append_new
 * and json_object_update_new do, and keep in mind whether that failed. */
void saga_json_set_value(json_t *object, const char *key, json_t *value);
void saga_json_append_item(json_t *array, json_t *value);
void saga_json_merge_object(json_t *object, json_t *other);

/* Reads a file whose root is an object; json_decref it. NULL with the error:
 * where memory ended, where it is no JSON, and in which line. */
json_t *saga_json_read(const char *path, saga_error *error);

#endif
