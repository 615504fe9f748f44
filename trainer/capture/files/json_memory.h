/* SPDX-License-Identifier: MIT
 *
 * Records failures of jansson that it does not report. If memory is short it
 * may turn a string into an invalid token, or drop a digit of a long number and
 * accept it. If a value cannot be added to a list (no memory, text that is not
 * UTF-8, a number that is not finite), the list does not show it later.
 */
#ifndef SAGA_JSON_MEMORY_H
#define SAGA_JSON_MEMORY_H

#include "error.h"
#include "file.h"

#include <jansson.h>
#include <stdbool.h>

/* Begins to record jansson's failures in this thread. */
void saga_json_watch(void);
/* Returns whether an allocation has failed since saga_json_watch. */
bool saga_json_starved(void);
/* Returns whether one of the functions below has failed since saga_json_watch,
 * so that a value is missing. */
bool saga_json_lost(void);

/* These functions do what jansson's json_object_set_new_nocheck,
 * json_array_append_new and json_object_update_new do, and record failures. The
 * first two return false on failure; the value has been released then. */
bool saga_json_set_value(json_t *object, const char *key, json_t *value);
bool saga_json_append_item(json_t *array, json_t *value);
void saga_json_merge_object(json_t *object, json_t *other);

/* Reads a file whose root is an object; the caller releases it with
 * json_decref. NaN, Infinity and the like become strings, so that who wants a
 * number refuses them by name. Returns NULL, with *error set, if memory is
 * short or the file is not JSON (with the line). */
json_t *saga_json_read(const char *path, saga_error *error);

/* Parses a text like saga_json_read. The text is a part of a file: a NUL
 * follows somewhere after it. */
json_t *saga_json_parse(const saga_bytes *text, const char *path,
                        saga_error *error);

#endif
