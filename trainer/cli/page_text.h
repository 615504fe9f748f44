/* SPDX-License-Identifier: MIT
 *
 * Texts in pages: names as HTML and as parts of addresses.
 */
#ifndef SAGA_PAGE_TEXT_H
#define SAGA_PAGE_TEXT_H

#include "error.h"

#include <stdio.h>

/* Writes a text into HTML, also into an attribute, with the special characters
 * < > & " ' escaped. The text must be safe to show (utf8.h). */
void saga_page_put(FILE *page, const char *text);

/* Returns "FOLDER/NAME" of the first n characters of a folder, as they are, and
 * of a name, in which everything except letters, digits and . - _ is written as
 * %XX. The caller frees it. Returns NULL with *error set if memory is short. */
char *saga_page_address(const char *folder, size_t n, const char *name,
                        saga_error *error);

#endif
