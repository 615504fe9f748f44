/* SPDX-License-Identifier: MIT */
#include "suffix.h"

#include "morton.h"

#include <math.h>

uint32_t saga_suffix_of(const double o[4], uint32_t bits)
{
    const double most = (1 << bits) - 1;
    uint32_t v[4], axis;

    for (axis = 0; axis < 4; axis++) {
        /* -1..1 is divided into 2^bits cells; outside values get the outermost
         * one. */
        const double x = floor((o[axis] + 1) * (1 << bits) / 2);

        v[axis] = (uint32_t)(x < 0 ? 0 : x > most ? most : x);
    }
    return saga_morton_suffix(v, bits);
}

double saga_suffix_centre(uint32_t suffix, uint32_t bits, uint32_t axis)
{
    return (2 * saga_morton_axis(suffix, axis) + 1) / (double)(1u << bits) - 1;
}
