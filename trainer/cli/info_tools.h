/* SPDX-License-Identifier: MIT
 *
 * Parts of the report of `saga info`: which tools of the format a file uses.
 */
#ifndef SAGA_INFO_TOOLS_H
#define SAGA_INFO_TOOLS_H

#include "json_cli.h"
#include "saga.h"

#include <stdint.h>

/* Returns an object with a flag for each tool. `line` receives the names of
 * those that the file uses, for the text, with commas between them. */
json_t *saga_info_tools(const saga_info *info, json_t *line);
/* Returns a list of the classes of coarse anchors, with their features. It is
 * empty for a file without classes. bytes has a header that saga_probe takes.
 */
json_t *saga_info_classes(const uint8_t *bytes);

#endif
