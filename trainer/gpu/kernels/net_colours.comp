/* SPDX-License-Identifier: MIT
 *
 * Colours from the last network's outputs. A thread for each number. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer colour_block
{
    float colour[]; /* (n_own, 3) */
};
layout(std430, set = 0, binding = 2) writeonly buffer value_block
{
    float value[];
};

void main()
{
    const uint k = thread_index();

    if (k < 3 * f.n_own)
        value[f.attr_at[COLOUR] + k] = clamp(0.5 + colour[k], 0, 1);
}
