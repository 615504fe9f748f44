/* SPDX-License-Identifier: MIT */
#include "notes.h"

#include "utf8.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

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

void saga_copy_name(char name[SAGA_NAME_NBYTES], const char *s, size_t n)
{
    saga_utf8_copy(name, SAGA_NAME_NBYTES, s, n);
    for (char *p = name; *p; p++) {
        const unsigned char c = (unsigned char)*p;
        if (c < 0x20 || c == 0x7f || c == ',' || c == '/')
            *p = '_';
    }
}
