/* SPDX-License-Identifier: MIT
 *
 * Attributes, without colours, from the outputs of F_geo:
 * scene/twin_forward.c, take_rows() and set_places(). A thread for each
 * primitive. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer place_block
{
    float place[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 2) readonly buffer support_block
{
    float support[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 3) readonly buffer level_block
{
    float level[]; /* (n, 2) constants of log2 sizes, in space and time */
};
layout(std430, set = 0, binding = 4) readonly buffer part_block
{
    uint part[]; /* (n_geo, 2) a word, and the bits of a constant */
};
layout(std430, set = 0, binding = 5) readonly buffer geo_block
{
    float geo[]; /* (n, n_geo) */
};
layout(std430, set = 0, binding = 6) writeonly buffer value_block
{
    float value[];
};

#include "parts.glsl"

void put(uint i, uint attr, uint k, float x)
{
    value[f.attr_at[attr] + f.attr_width[attr] * i + k] = x;
}

/* Returns the value of a component whose output is x. */
float value_of(uint i, uint unit, float x)
{
    switch (unit) {
    case LOG2_LENGTH:
        return x + level[2 * i];
    case LOG2_TIME:
        return x + level[2 * i + 1];
    case IN_SUPPORTS:
        return clamp(x, -most_motion, most_motion);
    case TIME:
        return clamp(place[4 * i + 3] + support[4 * i + 3] * x, centre_lo,
                     centre_hi);
    default:
        return x;
    }
}

void main()
{
    const uint i = thread_index();

    if (i >= n)
        return;
    for (uint k = 0; k < 3; k++)
        put(i, MEAN, k, place[4 * i + k]);
    for (uint k = 0; (f.attrs >> SUPPORT & 1) != 0 && k < 3; k++)
        put(i, SUPPORT, k, support[4 * i + k]);
    /* A motion has all orders, of which networks may output some. */
    for (uint k = 0; (f.attrs >> MOTION & 1) != 0 && k < f.attr_width[MOTION];
         k++)
        put(i, MOTION, k, 0);
    for (uint k = 0; k < n_geo; k++) {
        const uint word = part[2 * k];

        if (part_attr(word) < N_ATTRS)
            put(i, part_attr(word), part_at(word),
                value_of(i, part_unit(word), geo[i * n_geo + k]) +
                    uintBitsToFloat(part[2 * k + 1]));
    }
}
