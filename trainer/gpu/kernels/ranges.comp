/* SPDX-License-Identifier: MIT
 *
 * Finds where the list of each tile begins and ends among the sorted pairs.
 * The ranges are zero before. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer total_block
{
    uint total[];
};
layout(std430, set = 0, binding = 2) readonly buffer tile_block
{
    uint tile[];
};
layout(std430, set = 0, binding = 3) writeonly buffer range_block
{
    uint range[]; /* (tiles, 2) begin and end */
};

void main()
{
    const uint begin = group_index() * SORT_BLOCK;
    const uint n_tiles = f.n_tiles_x * f.n_tiles_y, n = total[N_PAIRS];

    for (uint k = gl_LocalInvocationIndex; k < SORT_BLOCK; k += THREADS) {
        const uint at = begin + k;

        if (at >= n || tile[at] >= n_tiles)
            continue;
        if (at == 0 || tile[at - 1] != tile[at])
            range[2 * tile[at]] = at;
        if (at + 1 == n || tile[at + 1] != tile[at])
            range[2 * tile[at] + 1] = at + 1;
    }
}
