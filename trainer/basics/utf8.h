/* SPDX-License-Identifier: MIT
 *
 * Names from folders and other programs' files may have any bytes, but files of
 * saga, JSON and terminals take only UTF-8 (RFC 3629).
 */
#ifndef SAGA_UTF8_H
#define SAGA_UTF8_H

#include <stdbool.h>
#include <stddef.h>

/* Returns the length of the first character of n bytes, 1 to 4, or 0 if they
 * begin with none. Overlong forms, surrogates and truncated characters are
 * none. */
size_t saga_utf8_length(const char *s, size_t n);

/* Tells whether a string is UTF-8. */
bool saga_utf8_is(const char *s);

/* Copies n bytes as text that may be shown anywhere, with a NUL after it: all
 * that comes from files, and the names of files, passes through here before it
 * reaches a terminal, a report or a page. A byte that belongs to no character,
 * and each byte of a character that is not seen or changes what stands around
 * it (controls, as in escape sequences, and directions of writing), becomes
 * %XX, so different names stay different and can be typed. The copy is cut
 * after a whole character, to at most `capacity` bytes with the NUL. */
void saga_utf8_copy(char *to, size_t capacity, const char *from, size_t n);

#endif
