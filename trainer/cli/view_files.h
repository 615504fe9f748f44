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
#include <string.h>

typedef struct saga_view_file {
    const char *name; /* file name without a folder */
    const uint8_t *bytes;
    size_t nbytes;
} saga_view_file;

extern const saga_view_file saga_view_files[];
extern const int saga_n_view_files;

extern const saga_view_file saga_report_files[];
extern const int saga_n_report_files;

/* Returns the file of ports/web with this name; NULL if the build lacks it. */
static inline const saga_view_file *saga_view_file_find(const char *name)
{
    for (int i = 0; i < saga_n_view_files; i++)
        if (strcmp(saga_view_files[i].name, name) == 0)
            return &saga_view_files[i];
    return NULL;
}

/* Returns where a text is in a page from `at` on. The page must have it: pages
 * are compiled in. */
static inline const char *saga_view_text_find(const char *at, const char *text)
{
    while (memcmp(at, text, strlen(text)) != 0)
        at++;
    return at;
}

#endif
