/* SPDX-License-Identifier: MIT */
#include "splat_colour.h"

static const real half = R(0.5);

void saga_splat_colour_forward(real *colour, const real *c, size_t n)
{
    size_t i;

    for (i = 0; i < n; i++) {
        const real x = half + c[i];

        colour[i] = x < 0 ? 0 : x > 1 ? 1 : x;
    }
}

static int passes(real c, real d, int clamp)
{
    if ((c >= -half && c <= half) || clamp == SAGA_CLAMP_STRAIGHT)
        return 1;
    return clamp == SAGA_CLAMP_INWARD && (c < 0 ? d < 0 : d > 0);
}

void saga_splat_colour_backward(real *d_c, const real *d_colour,
                                const real *c, size_t n, int clamp)
{
    size_t i;

    for (i = 0; i < n; i++)
        if (passes(c[i], d_colour[i], clamp))
            d_c[i] += d_colour[i];
}
