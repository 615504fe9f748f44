/* SPDX-License-Identifier: MIT */
#include "notes.h"

#include "utf8.h"

#include <stdarg.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>

enum {
    LISTED = 3, /* items in a line; the others are counted */
    ITEM_NBYTES = 256
};

void saga_note(char *notes, const char *format, ...)
{
    const size_t used = strlen(notes);
    char line[SAGA_NOTES_NBYTES];
    if (used + 2 >= SAGA_NOTES_NBYTES)
        return;
    va_list args;
    va_start(args, format);
    (void)vsnprintf(line, sizeof line, format, args);
    va_end(args);
    /* Paths in a note may have another encoding, or be cut inside a
     * character. */
    saga_utf8_copy(notes + used, SAGA_NOTES_NBYTES - used - 1, line,
                   strlen(line));
    const size_t end = strlen(notes);
    notes[end] = '\n';
    notes[end + 1] = '\0';
}

/* Returns the line of a buffer that begins with `before` and ends with `after`,
 * and sets *n to its length; NULL: there is none. */
static char *find_line(char *notes, const char *before, const char *after,
                       size_t *n)
{
    const size_t head = strlen(before), tail = strlen(after);
    for (char *line = notes; *line; line += *n + (line[*n] == '\n')) {
        *n = strcspn(line, "\n");
        if (*n >= head + tail && memcmp(line, before, head) == 0 &&
            memcmp(line + *n - tail, after, tail) == 0)
            return line;
    }
    return NULL;
}

/* Writes a list of n bytes with one item more: the item itself or, if enough
 * are listed, the number of those that are not. */
static void add_to_list(char to[SAGA_NOTES_NBYTES], const char *list, size_t n,
                        const char *item)
{
    size_t at = n, n_items = 1, more = 0;
    while (at > 0 && strncmp(list + at, " and ", 5) != 0)
        at--;
    const bool counted = at > 0 &&
                         sscanf(list + at, " and %zu more", &more) == 1;
    const int kept = (int)(counted ? at : n);
    for (int i = 0; i < kept; i++)
        n_items += strncmp(list + i, ", ", 2) == 0;
    if (n_items < LISTED)
        (void)snprintf(to, SAGA_NOTES_NBYTES, "%.*s, %s", kept, list, item);
    else
        (void)snprintf(to, SAGA_NOTES_NBYTES, "%.*s and %zu more", kept, list,
                       more + 1);
}

void saga_note_each(char *notes, const saga_note_kind *kind, const char *format,
                    ...)
{
    char list[SAGA_NOTES_NBYTES], item[ITEM_NBYTES], text[ITEM_NBYTES];
    const size_t head = strlen(kind->before), tail = strlen(kind->after);
    size_t n;
    va_list args;
    va_start(args, format);
    (void)vsnprintf(item, sizeof item, format, args);
    va_end(args);
    char *const line = find_line(notes, kind->before, kind->after, &n);
    if (!line) {
        saga_note(notes, "%s%s%s", kind->before, item, kind->after);
        return;
    }
    /* The list stands between both texts; what follows it is moved. */
    char *const from = line + head;
    const size_t was = n - head - tail;
    saga_utf8_copy(text, sizeof text, item, strlen(item));
    add_to_list(list, from, was, text);
    const size_t is = strlen(list), rest = strlen(from + was) + 1;
    if (strlen(notes) + is - was >= SAGA_NOTES_NBYTES)
        return;
    memmove(from + is, from + was, rest);
    memcpy(from, list, is);
}

void saga_copy_name(char name[SAGA_NAME_NBYTES], const char *s, size_t n)
{
    saga_utf8_copy(name, SAGA_NAME_NBYTES, s, n);
    for (char *p = name; *p; p++) {
        if (*p == ',' || *p == '/')
            *p = '_';
    }
}
