/* SPDX-License-Identifier: MIT
 *
 * Reports are written as JSON, whole or not at all.
 */
#ifndef SAGA_JSON_CLI_H
#define SAGA_JSON_CLI_H

#include <jansson.h>

/* Reports have a schema's number: a key that is there keeps its meaning while
 * the number is the same; keys may be added. */
enum { SAGA_JSON_SCHEMA = 1 };

/* Returns an object with what every report begins with: "schema", "program"
 * (with its version), "command", and the "file" it is about. */
json_t *saga_cli_json_head(const char *command, const char *file);

/* Says before long work whether a report can have a file's or folder's name;
 * NULL: there is none. The exit status. */
int saga_cli_json_can_tell(const char *command, const char *name);

/* Prints o, and frees it; o was built by json_memory.h since saga_json_watch,
 * and where something of it could not be told, that is an error. Reals have
 * `precision` digits. file is for messages: its name is in o. The exit status.
 */
int saga_cli_print_json(json_t *o, size_t precision, const char *file);

/* Does the same into the file. */
int saga_cli_write_json(json_t *o, size_t precision, const char *file);

#endif
