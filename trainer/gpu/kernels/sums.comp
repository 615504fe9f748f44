/* SPDX-License-Identifier: MIT
 *
 * Adds the squares of the tiles, and the sizes of primitives for their mean.
 * One group does everything. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) buffer total_block
{
    uint total[];
};
layout(std430, set = 0, binding = 2) readonly buffer squares_block
{
    float squares[];
};
layout(std430, set = 0, binding = 3) readonly buffer size_block
{
    float size_sum[];
};
layout(push_constant) uniform push_block
{
    uint n_sizes; /* groups that added sizes, or 0 */
};

shared float part[2][THREADS];

void main()
{
    const uint k = gl_LocalInvocationIndex;
    const uint n_tiles = f.n_tiles_x * f.n_tiles_y;

    part[0][k] = part[1][k] = 0;
    for (uint j = k; j < n_tiles; j += THREADS)
        part[0][k] += squares[j];
    for (uint j = k; j < n_sizes; j += THREADS)
        part[1][k] += size_sum[j];
    barrier();
    for (uint half_n = THREADS / 2; half_n > 0; half_n /= 2) {
        for (uint j = 0; k < half_n && j < 2; j++)
            part[j][k] += part[j][k + half_n];
        barrier();
    }
    if (k == 0) {
        total[SQUARES] = floatBitsToUint(part[0][0]);
        total[TYPICAL] = floatBitsToUint(part[1][0] / float(3 * f.n_own));
    }
}
