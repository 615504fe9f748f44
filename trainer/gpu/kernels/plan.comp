/* SPDX-License-Identifier: MIT
 *
 * Notes how many pairs the picture has. If there is no room for them it gets
 * none, and the host runs it again with more. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(push_constant) uniform push_block
{
    uint n_blocks; /* of the sum over primitives */
};
layout(std430, set = 0, binding = 1) readonly buffer sum_block
{
    uint sum[];
};
layout(std430, set = 0, binding = 2) writeonly buffer total_block
{
    uint total[];
};

void main()
{
    const uint n = sum[n_blocks];
    const bool is_full = n > f.most_pairs;

    if (gl_LocalInvocationIndex > 0)
        return;
    total[N_PAIRS] = is_full ? 0 : n;
    total[WANTED] = n;
    total[IS_FULL] = is_full ? 1 : 0;
    total[IS_UNSOUND] = 0;
}
