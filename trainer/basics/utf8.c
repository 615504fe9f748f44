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
                   (c < 0xd800 || c > 0xdfff)
               ? length
               : 0;
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

/* Returns the code point of the character of n bytes, which is valid. */
static uint32_t code_of(const char *s, size_t n)
{
    uint32_t c = n == 1 ? (uint8_t)s[0] : (uint8_t)s[0] & (0x7fu >> n);

    for (size_t i = 1; i < n; i++)
        c = c << 6 | ((uint8_t)s[i] & 0x3f);
    return c;
}

static bool is_shown(uint32_t c)
{
    /* Unicode's controls (Cc), separators of lines and paragraphs (Zl, Zp),
     * and those of its format characters (Cf) that act on their neighbours. */
    static const struct {
        uint32_t first, last;
    } hidden[] = { { 0, 0x1f },         { 0x7f, 0x9f },     { 0xad, 0xad },
                   { 0x61c, 0x61c },    { 0x200b, 0x200f }, { 0x2028, 0x202e },
                   { 0x2060, 0x206f },  { 0xfeff, 0xfeff }, { 0xfff9, 0xfffb },
                   { 0xe0000, 0xe007f } };

    for (size_t i = 0; i < sizeof hidden / sizeof *hidden; i++)
        if (c >= hidden[i].first && c <= hidden[i].last)
            return false;
    return true;
}

void saga_utf8_copy(char *to, size_t capacity, const char *from, size_t n)
{
    static const char digit[] = "0123456789ABCDEF";
    size_t used = 0;

    while (n > 0) {
        const size_t k = saga_utf8_length(from, n);
        const bool shown = k && is_shown(code_of(from, k));
        const size_t taken = k ? k : 1, written = shown ? k : 3 * taken;

        if (used + written >= capacity)
            break;
        for (size_t i = 0; i < taken; i++, from++)
            if (shown) {
                to[used++] = *from;
            } else {
                to[used++] = '%';
                to[used++] = digit[(uint8_t)*from >> 4];
                to[used++] = digit[(uint8_t)*from & 15];
            }
        n -= taken;
    }
    to[used] = '\0';
}
