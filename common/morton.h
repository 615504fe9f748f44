/* SPDX-License-Identifier: MIT
 *
 * 4-D Morton order, which is the order of all ranks: a suffix of 4 B bits
 * interleaves x, y, z, t of B bits each, x first, most significant bits first.
 */
#ifndef SAGA_MORTON_H
#define SAGA_MORTON_H

#include <stdint.h>

/* Returns the coordinate of `axis` (0..3: x, y, z, t) in a suffix, whose bits
 * above its 4 B are 0. */
static inline uint32_t saga_morton_axis(uint32_t suffix, uint32_t axis)
{
    uint32_t v = suffix >> (3 - axis) & 0x11111111u;

    /* Bits that are 4 apart close up to pairs, then to fours, then to eight. */
    v = (v | v >> 3) & 0x03030303u;
    v = (v | v >> 6) & 0x000f000fu;
    return (v | v >> 12) & 255u;
}

/* Returns the suffix of the coordinates v[0..3], which have `bits` bits each;
 * bits is in 0..8. */
static inline uint32_t saga_morton_suffix(const uint32_t v[4], uint32_t bits)
{
    uint32_t suffix = 0, i, axis;

    for (i = 0; i < bits; i++)
        for (axis = 0; axis < 4; axis++)
            suffix |= (v[axis] >> i & 1u) << (4 * i + 3 - axis);
    return suffix;
}

/* Returns the modulo group of integer coordinates (paper: gamma). */
static inline uint32_t saga_morton_group(const uint32_t v[4], uint32_t n_groups)
{
    uint32_t g = (v[0] & 1u) | (v[1] & 1u) << 1 | (v[2] & 1u) << 2 |
                 (v[3] & 1u) << 3;

    while (g >= n_groups)
        g -= n_groups;
    return g;
}

#endif
