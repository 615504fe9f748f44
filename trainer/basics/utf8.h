/* SPDX-License-Identifier: MIT
 *
 * Names come from folders and files of other programs, whose bytes may be
 * anything; files of ours, JSON and terminals take UTF-8 (RFC 3629) alone.
 */
#ifndef SAGA_UTF8_H
#define SAGA_UTF8_H

#include <stdbool.h>
#include <stddef.h>

/* Returns how many of n bytes the first character takes, 1 to 4; 0 where they
 * begin with none: overlong forms, surrogates and what is cut are none. */
size_t saga_utf8_length(const char *s, size_t n);

/* Tells whether a string is UTF-8. */
bool saga_utf8_is(const char *s);

/* Copies n bytes as UTF-8, a 0 behind it, cut behind a character so that it
 * takes `capacity` bytes at most: each byte that belongs to no character
 * becomes %XX. So names that differ do so still, and can be typed. */
void saga_utf8_copy(char *to, size_t capacity, const char *from, size_t n);

#endif
