/* SPDX-License-Identifier: MIT
 *
 * The position of an anchor or primitive within its parent: offsets, and the
 * suffixes that number the cells of a parent's grid.
 */
#ifndef SAGA_SUFFIX_H
#define SAGA_SUFFIX_H

#include <stdint.h>

/* The limit of offsets in half-sizes or supports, so that they fit int16 in
 * Q14. */
#define SAGA_OFFSET_MAX 1.9999

static inline double saga_clamp_offset(double o)
{
    return o < -SAGA_OFFSET_MAX  ? -SAGA_OFFSET_MAX
           : o > SAGA_OFFSET_MAX ? SAGA_OFFSET_MAX
                                 : o;
}

/* Return the suffix of an offset, given in supports of the parent: its cell in
 * a grid of 2^bits cells per axis over -1..1, clamped to the grid; and the
 * centre of a cell on an axis. */
uint32_t saga_suffix_of(const double o[4], uint32_t bits);
double saga_suffix_centre(uint32_t suffix, uint32_t bits, uint32_t axis);

#endif
