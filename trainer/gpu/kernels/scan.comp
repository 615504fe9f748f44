/* SPDX-License-Identifier: MIT
 *
 * Exclusive sums of numbers, in blocks of 1,024: each block's own here, the
 * blocks' sums by scan_top.comp, and both together by scan_add.comp. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "prefix.glsl"

layout(push_constant) uniform push_block
{
    uint n;         /* numbers */
    uint is_listed; /* 1: number k is from[order[k]] */
};
layout(std430, set = 0, binding = 1) readonly buffer from_block
{
    uint from[];
};
layout(std430, set = 0, binding = 2) readonly buffer order_block
{
    uint order[];
};
layout(std430, set = 0, binding = 3) writeonly buffer to_block
{
    uint to[];
};
layout(std430, set = 0, binding = 4) writeonly buffer sum_block
{
    uint sum[];
};

const uint EACH = SORT_BLOCK / THREADS;

void main()
{
    const uint begin = group_index() * SORT_BLOCK +
                       gl_LocalInvocationIndex * EACH;
    uint x[EACH], total = 0, all, before;

    if (group_index() * SORT_BLOCK >= n)
        return;
    for (uint k = 0; k < EACH; k++) {
        const uint at = begin + k;

        x[k] = at >= n ? 0 : from[is_listed != 0 ? order[at] : at];
        total = plus(total, x[k]);
    }
    before = prefix_sum(total, all);
    for (uint k = 0; k < EACH; k++) {
        if (begin + k < n)
            to[begin + k] = before;
        before += x[k];
    }
    if (gl_LocalInvocationIndex == 0)
        sum[group_index()] = all;
}
