/* SPDX-License-Identifier: MIT
 *
 * The direction from the camera to each primitive in the middle of the segment:
 * scene/twin_forward.c, set_direction(). */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer value_block
{
    float value[];
};
layout(std430, set = 0, binding = 2) writeonly buffer direction_block
{
    float direction[]; /* (n_own, 3) */
};

float load(uint i, uint attr, uint at)
{
    return value[f.attr_at[attr] + f.attr_width[attr] * i + at];
}

bool has(uint i, uint attr)
{
    return (f.attrs >> attr & 1) != 0;
}

#include "primitive.glsl"

void main()
{
    const uint i = thread_index();
    vec3 d;
    float norm2;

    if (i >= f.n_own)
        return;
    d = animate_at(i, 0.5).mean - vec3(f.centre[0], f.centre[1], f.centre[2]);
    norm2 = dot(d, d);
    for (uint k = 0; k < 3; k++)
        direction[3 * i + k] = norm2 > 0 ? d[k] / sqrt(norm2) : 0;
}
