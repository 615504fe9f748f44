/* SPDX-License-Identifier: MIT */
#include "base64.h"

#include "alloc.h"

#include <string.h>

char *saga_base64(const char *prefix, const uint8_t *bytes, size_t n,
                  saga_error *error)
{
    static const char digits[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
                                 "abcdefghijklmnopqrstuvwxyz0123456789+/";
    const size_t start = strlen(prefix);
    char *const text = saga_alloc(start + (n + 2) / 3 * 4 + 1, 1, "a page",
                                  error);
    char *to = text + start;

    if (!text)
        return NULL;
    memcpy(text, prefix, start);
    /* Three bytes make four digits; = pads a last group of fewer bytes. */
    for (size_t i = 0; i < n; i += 3) {
        const size_t left = n - i;
        const uint32_t v = (uint32_t)bytes[i] << 16 |
                           (left > 1 ? (uint32_t)bytes[i + 1] << 8 : 0u) |
                           (left > 2 ? bytes[i + 2] : 0u);

        *to++ = digits[v >> 18];
        *to++ = digits[v >> 12 & 63];
        *to++ = left > 1 ? digits[v >> 6 & 63] : '=';
        *to++ = left > 2 ? digits[v & 63] : '=';
    }
    *to = '\0';
    return text;
}
