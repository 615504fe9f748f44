/* SPDX-License-Identifier: MIT
 *
 * Files as they lie in the program: tools/embed.sh makes the tables at build
 * time. Those of ports/web are for `saga view`; the decoder for browsers,
 * saga.wasm, is missing where there was no compiler for it. The page of `saga
 * report` is the only one of its table.
 */
#ifndef SAGA_VIEW_FILES_H
#define SAGA_VIEW_FILES_H

#include <stddef.h>
#include <stdint.h>

typedef struct saga_view_file {
    const char *name;        /* without a folder */
    const uint8_t *bytes;
    size_t nbytes;
} saga_view_file;

extern const saga_view_file saga_view_files[];
extern const int saga_n_view_files;

extern const saga_view_file saga_report_files[];
extern const int saga_n_report_files;

#endif
