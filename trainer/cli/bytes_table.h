/* SPDX-License-Identifier: MIT
 *
 * `saga info` and `saga eval` both tell bytes by component.
 */
#ifndef SAGA_BYTES_TABLE_H
#define SAGA_BYTES_TABLE_H

#include "layout.h"

#include <jansson.h>

/* Prints a table on stdout; components without bytes are left out. */
void saga_bytes_table_print(const saga_layout *layout);

/* Returns an object of all components; their sum is the file's size. */
json_t *saga_bytes_table_json(const saga_layout *layout);

#endif
