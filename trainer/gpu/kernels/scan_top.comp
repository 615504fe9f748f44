/* SPDX-License-Identifier: MIT
 *
 * Replaces the sums of n blocks by exclusive ones, and appends the sum of
 * all. One group does everything. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "prefix.glsl"

layout(push_constant) uniform push_block
{
    uint n;
};
layout(std430, set = 0, binding = 1) buffer sum_block
{
    uint sum[];
};

void main()
{
    uint base = 0, all;

    for (uint begin = 0; begin < n; begin += THREADS) {
        const uint at = begin + gl_LocalInvocationIndex;
        const uint before = prefix_sum(at < n ? sum[at] : 0, all);

        if (at < n)
            sum[at] = base + before;
        base = plus(base, all);
    }
    if (gl_LocalInvocationIndex == 0)
        sum[n] = base;
}
