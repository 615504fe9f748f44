/* SPDX-License-Identifier: MIT
 *
 * Adds to the sums of scan.comp those of the blocks before. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(push_constant) uniform push_block
{
    uint n;
};
layout(std430, set = 0, binding = 1) buffer to_block
{
    uint to[];
};
layout(std430, set = 0, binding = 2) readonly buffer sum_block
{
    uint sum[];
};

void main()
{
    const uint begin = group_index() * SORT_BLOCK;

    for (uint k = gl_LocalInvocationIndex; k < SORT_BLOCK; k += THREADS)
        if (begin + k < n)
            to[begin + k] += sum[group_index()];
}
