/* SPDX-License-Identifier: MIT
 *
 * Positions of primitives with noise of one step, or rounded, and their offsets
 * from their anchors, both as embedded and as coded: train/fit/fit.c,
 * use_positions(), and scene/twin.c, prim_offsets(). A thread for each axis of
 * a primitive. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "group.glsl"
#include "rng.glsl"

layout(push_constant) uniform push_block
{
    uint n;
    uint rounds;
    uint key_low;
    uint key_high;
    float step;
    float most;    /* of offsets, in supports */
    float n_cells; /* of a parent's grid, along an axis */
};

layout(std430, set = 0, binding = 0) readonly buffer x_block
{
    float x[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 1) readonly buffer anchor_block
{
    float anchor[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 2) readonly buffer support_block
{
    float support[]; /* (n, 4) of the iteration before */
};
layout(std430, set = 0, binding = 3) readonly buffer mu_block
{
    float mu[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 4) writeonly buffer place_block
{
    float place[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 5) writeonly buffer offset_block
{
    float offset[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 6) writeonly buffer value_block
{
    float value[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 7) writeonly buffer shift_block
{
    float shift[]; /* (n, 4) */
};

/* Returns the centre of the cell of an offset: code/suffix.c. */
float centre(float o)
{
    const float cell = clamp(floor((o + 1) * n_cells / 2), 0, n_cells - 1);

    return (2 * cell + 1) / n_cells - 1;
}

void main()
{
    const uint k = thread_index();
    float was, o, at;

    if (k >= 4 * n)
        return;
    was = (x[k] - anchor[k]) / support[k];
    if (rounds != 0) {
        const float from = mu[k] + centre(was);

        o = from + floor((was - from) / step + 0.5) * step;
    } else {
        o = was + step * noise(uvec2(key_low, key_high), uvec2(k, 0));
    }
    at = anchor[k] + support[k] * o;
    shift[k] = support[k] * (o - was);
    o = clamp((at - anchor[k]) / support[k], -most, most);
    place[k] = at;
    offset[k] = o;
    value[k] = o - centre(o);
}
