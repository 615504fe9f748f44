/* SPDX-License-Identifier: MIT
 *
 * Says where an anchor or primitive lies in its parent: offsets, and the
 * suffixes that number the cells of a parent's grid.
 */
#ifndef SAGA_SUFFIX_H
#define SAGA_SUFFIX_H

#include <stdint.h>

/* Offsets in half-sizes or supports stay within this, for the int16 of Q14. */
#define SAGA_OFFSET_MAX 1.9999

static inline double saga_clamp_offset(double o)
{
    return o < -SAGA_OFFSET_MAX ? -SAGA_OFFSET_MAX
         : o > SAGA_OFFSET_MAX ? SAGA_OFFSET_MAX : o;
}

/* The first returns the suffix of an offset, in supports of its parent: its
 * cell in a grid of 2^bits cells an axis over -1..1, clamped to it; and a
 * cell's centre on an axis. */
uint32_t saga_suffix_of(const double o[4], uint32_t bits);
double saga_suffix_centre(uint32_t suffix, uint32_t bits, uint32_t axis);

#endif
