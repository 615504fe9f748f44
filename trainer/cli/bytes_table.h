/* SPDX-License-Identifier: MIT
 *
 * `saga info` and `saga eval` both tell bytes by component.
 */
#ifndef SAGA_BYTES_TABLE_H
#define SAGA_BYTES_TABLE_H

#include "json_cli.h"
#include "layout.h"

/* Puts "bytes" into a report: an object of all components, whose sum is the
 * file's size. */
void saga_put_bytes(json_t *report, const saga_layout *layout);

/* These lines print it; components without bytes are left out. */
#define SAGA_BYTES_LINES \
    { "", NULL, "\nbytes\n" }, \
    { "nbytes", "/bytes", "  {name:%-18s} {nbytes:%12d}  {part*100:%5.1f} %\n" }

#endif
