/* SPDX-License-Identifier: MIT */
#include "notes.h"

#include <stdarg.h>
#include <stdio.h>
#include <string.h>

void saga_note(char *notes, const char *format, ...)
{
    const size_t used = strlen(notes);
    if (used + 2 >= SAGA_NOTES_NBYTES)
        return;
    va_list args;
    va_start(args, format);
    (void)vsnprintf(notes + used, SAGA_NOTES_NBYTES - used - 1, format, args);
    va_end(args);
    const size_t end = strlen(notes);
    notes[end] = '\n';
    notes[end + 1] = '\0';
}

void saga_copy_name(char name[SAGA_NAME_NBYTES], const char *s, size_t n)
{
    if (n > SAGA_NAME_NBYTES - 1)
        n = SAGA_NAME_NBYTES - 1;
    for (size_t i = 0; i < n; i++) {
        const unsigned char c = (unsigned char)s[i];
        name[i] = c < 0x20 || c == 0x7f || c == ',' || c == '/' ? '_' : s[i];
    }
    name[n] = '\0';
}
