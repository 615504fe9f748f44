/* SPDX-License-Identifier: MIT
 *
 * Files embedded in the program: tools/embed.sh generates the tables at build
 * time. Those of ports/web are for `saga view`; the decoder for browsers,
 * saga.wasm, is missing if the build had no compiler for it. The other table
 * holds only the page of `saga report`.
 */
#ifndef SAGA_VIEW_FILES_H
#define SAGA_VIEW_FILES_H

#include <stddef.h>
#include <stdint.h>

typedef struct saga_view_file {
    const char *name; /* file name without a folder */
    const uint8_t *bytes;
    size_t nbytes;
} saga_view_file;

extern const saga_view_file saga_view_files[];
extern const int saga_n_view_files;

extern const saga_view_file saga_report_files[];
extern const int saga_n_report_files;

#endif
