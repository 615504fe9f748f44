/* SPDX-License-Identifier: MIT
 *
 * Reports are written as JSON, whole or not at all.
 */
#ifndef SAGA_JSON_CLI_H
#define SAGA_JSON_CLI_H

#include <jansson.h>

/* Prints o, and frees it; o was built since saga_json_watch (json_memory.h).
 * Reals have `precision` digits. file is for messages: its name is in o. The
 * exit status. */
int saga_cli_print_json(json_t *o, size_t precision, const char *file);

#endif
