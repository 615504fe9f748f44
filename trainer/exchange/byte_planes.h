/* SPDX-License-Identifier: MIT
 *
 * Streams of numbers as the formats of films pack them: first the low bytes of
 * all numbers, then the next ones; and how much packers can shrink bytes, by
 * which sizes are judged before memory is taken.
 */
#ifndef SAGA_BYTE_PLANES_H
#define SAGA_BYTE_PLANES_H

#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_DEFLATE_RATIO = 1032,    /* deflate's highest ratio */
    SAGA_ZSTD_RATIO = 1 << 15     /* zstd's highest ratio: a block of 128 kB
                                   * takes at least 4 bytes */
};

/* Returns number i of n, which have `width` bytes each: planes (width, n). */
static inline uint32_t saga_plane_number(const uint8_t *planes, size_t n,
                                         int width, size_t i)
{
    uint32_t x = 0;

    for (int k = 0; k < width; k++)
        x |= (uint32_t)planes[(size_t)k * n + i] << 8 * k;
    return x;
}

/* Returns the signed number v that is stored as 2 v, or as -2 v - 1 if it is
 * negative; in two's complement. */
static inline uint32_t saga_plane_sign(uint32_t x)
{
    return x >> 1 ^ (0 - (x & 1));
}

#endif
