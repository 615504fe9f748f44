/* SPDX-License-Identifier: MIT
 *
 * Reads those parts of TOML 1.0 that calibration files use: tables; keys with
 * strings of one line, numbers, true and false; lists of these, also over
 * several lines; comments. Dates, dotted keys, inline tables, lists of tables
 * and strings of several lines are refused.
 */
#ifndef SAGA_TOML_H
#define SAGA_TOML_H

#include "error.h"

#include <jansson.h>

/* Reads a file as a tree of JSON in which all numbers are reals; the caller
 * releases it with json_decref. Tables and lists are nested at most eight deep.
 * Returns NULL, with *error set, if memory is short or the file is not what is
 * described above; the message names the line. */
json_t *saga_toml_read(const char *path, saga_error *error);

#endif
