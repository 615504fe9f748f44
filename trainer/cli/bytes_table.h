/* SPDX-License-Identifier: MIT
 *
 * The table of bytes by component that `saga info` and `saga eval` print.
 */
#ifndef SAGA_BYTES_TABLE_H
#define SAGA_BYTES_TABLE_H

#include "json_cli.h"
#include "layout.h"

/* Adds "bytes" to a report: an object with all components, whose sizes sum to
 * the size of the file. */
void saga_put_bytes(json_t *report, const saga_layout *layout);

/* The lines that print it; components without bytes are left out. */
#define SAGA_BYTES_LINES                                         \
    { "", NULL, "\nbytes\n" },                                   \
    {                                                            \
        "nbytes", "/bytes",                                      \
            "  {name:%-18s} {nbytes:%12d}  {part*100:%5.1f} %\n" \
    }

#endif
