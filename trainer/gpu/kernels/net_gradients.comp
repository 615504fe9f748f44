/* SPDX-License-Identifier: MIT
 *
 * Gradients of attributes back to the networks' outputs, to places and to log2
 * supports: scene/twin_backward.c, give_rows() and places_backward(), with
 * saga_twin_size_loss(). A thread for each primitive. */
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
layout(std430, set = 0, binding = 3) readonly buffer part_block
{
    uint part[];
};
layout(std430, set = 0, binding = 4) readonly buffer geo_block
{
    float geo[]; /* (n, n_geo) */
};
layout(std430, set = 0, binding = 5) readonly buffer colour_block
{
    float colour[]; /* (n, 3) */
};
layout(std430, set = 0, binding = 6) readonly buffer grad_block
{
    float grad[];
};
layout(std430, set = 0, binding = 7) writeonly buffer d_geo_block
{
    float d_geo[]; /* (n, n_geo) */
};
layout(std430, set = 0, binding = 8) writeonly buffer d_colour_block
{
    float d_colour[]; /* (n, 3) */
};
layout(std430, set = 0, binding = 9) writeonly buffer d_place_block
{
    float d_place_of[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 10) writeonly buffer d_log2_block
{
    float d_log2_of[]; /* (n, 4) of log2 supports */
};
layout(std430, set = 0, binding = 11) readonly buffer limit_block
{
    float limit[]; /* (n) outputs of log2 sizes from which on they cost
                    * size_price times the square of what exceeds it */
};

#include "parts.glsl"

float gradient(uint i, uint attr, uint k)
{
    return grad[f.attr_at[attr] + f.attr_width[attr] * i + k];
}

/* Returns the gradient of the output x of a temporal centre; adds to those of
 * the time and of its support. */
float centre_backward(uint i, float x, float d, inout vec4 d_place,
                      inout vec4 d_log2)
{
    const float t = place[4 * i + 3] + support[4 * i + 3] * x;
    const float d_t = t > centre_lo && t < centre_hi ? d : 0;

    d_place[3] += d_t;
    d_log2[3] += d_t * x * support[4 * i + 3] * LN_2;
    return d_t * support[4 * i + 3];
}

void main()
{
    const uint i = thread_index();
    vec4 d_place = vec4(0), d_log2 = vec4(0);

    if (i >= n)
        return;
    for (uint k = 0; k < 3; k++) {
        d_place[k] = gradient(i, MEAN, k);
        if ((f.attrs >> SUPPORT & 1) != 0)
            d_log2[k] = gradient(i, SUPPORT, k) * support[4 * i + k] * LN_2;
        d_colour[3 * i + k] = inward(gradient(i, COLOUR, k),
                                     0.5 + colour[3 * i + k], 0, 1);
    }
    for (uint k = 0; k < n_geo; k++) {
        const uint word = part[2 * k], at = i * n_geo + k;
        float d = 0;

        if (part_attr(word) < N_ATTRS)
            d = gradient(i, part_attr(word), part_at(word));
        if (part_unit(word) == LOG2_LENGTH)
            d += 2 * size_price * max(geo[at] - limit[i], 0);
        if (part_unit(word) == IN_SUPPORTS)
            d = inward(d, geo[at], -most_motion, most_motion);
        if (part_unit(word) == TIME)
            d = centre_backward(i, geo[at], d, d_place, d_log2);
        d_geo[at] = d;
    }
    for (uint k = 0; k < 4; k++) {
        d_place_of[4 * i + k] = d_place[k];
        d_log2_of[4 * i + k] = d_log2[k];
    }
}
