/* SPDX-License-Identifier: MIT
 *
 * Notes about a capture, and names that are safe to print.
 */
#ifndef SAGA_NOTES_H
#define SAGA_NOTES_H

#include "capture.h"

/* Appends a line, as UTF-8, to a buffer of SAGA_NOTES_NBYTES; truncates it if
 * the buffer is full. */
void saga_note(char *notes, const char *format, ...) SAGA_PRINTF(2, 3);

/* The words before and after the items of a note, which suit one and many. */
typedef struct saga_note_kind {
    const char *before, *after;
} saga_note_kind;

/* Appends a line with an item, such as a camera and its value. If the buffer
 * has a line of that kind, the item joins its list, so that a line says "A, B,
 * C and 14 more" of any number. An item has no ", ". */
void saga_note_each(char *notes, const saga_note_kind *kind, const char *format,
                    ...) SAGA_PRINTF(3, 4);

/* Copies s[0..n) as a name for messages, tables and files, as saga_utf8_copy
 * does; commas and slashes, which could disturb a list or a path, become '_'.
 */
void saga_copy_name(char name[SAGA_NAME_NBYTES], const char *s, size_t n);

#endif
