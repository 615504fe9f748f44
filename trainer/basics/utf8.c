/* SPDX-License-Identifier: MIT */
#include "utf8.h"

#include <stdint.h>
#include <string.h>

/* Returns the least code point that needs n bytes. */
static uint32_t least_of(size_t n)
{
    static const uint32_t least[] = { 0, 0, 0x80, 0x800, 0x10000 };

    return least[n];
}

size_t saga_utf8_length(const char *s, size_t n)
{
    const uint8_t *const p = (const uint8_t *)s;
    uint32_t c;
    size_t length, i;

    if (n == 0)
        return 0;
    if (p[0] < 0x80)
        return 1;
    length = p[0] >= 0xf0 ? 4 : p[0] >= 0xe0 ? 3 : 2;
    if (p[0] < 0xc0 || p[0] > 0xf7 || length > n)
        return 0;
    /* The first byte has 7 - length bits of the character, each further byte
     * 6. */
    c = p[0] & (0x7fu >> length);
    for (i = 1; i < length && (p[i] & 0xc0) == 0x80; i++)
        c = c << 6 | (p[i] & 0x3f);
    /* Overlong forms, code points above U+10FFFF and surrogates are refused. */
    return i == length && c >= least_of(length) && c <= 0x10ffff &&
           (c < 0xd800 || c > 0xdfff) ? length : 0;
}

bool saga_utf8_is(const char *s)
{
    size_t n = strlen(s);

    while (n > 0) {
        const size_t k = saga_utf8_length(s, n);

        if (k == 0)
            return false;
        s += k;
        n -= k;
    }
    return true;
}

void saga_utf8_copy(char *to, size_t capacity, const char *from, size_t n)
{
    static const char digit[] = "0123456789ABCDEF";
    size_t used = 0;

    while (n > 0) {
        const size_t k = saga_utf8_length(from, n);
        const uint8_t c = (uint8_t)from[0];

        if (used + (k ? k : 3) >= capacity)
            break;
        if (k) {
            memcpy(to + used, from, k);
        } else {
            to[used] = '%';
            to[used + 1] = digit[c >> 4];
            to[used + 2] = digit[c & 15];
        }
        used += k ? k : 3;
        from += k ? k : 1;
        n -= k ? k : 1;
    }
    to[used] = '\0';
}
