/* SPDX-License-Identifier: MIT
 *
 * Lists the pairs of splats and tiles, by depth and then by tile. The position
 * of a pair is its slot: the slots of a splat are consecutive. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "tile_columns.glsl"

layout(std430, set = 0, binding = 1) readonly buffer total_block
{
    uint total[];
};
layout(std430, set = 0, binding = 2) readonly buffer order_block
{
    uint order[];
};
layout(std430, set = 0, binding = 3) readonly buffer offset_block
{
    uint offset[];
};
layout(std430, set = 0, binding = 4) readonly buffer count_block
{
    uint count[];
};
layout(std430, set = 0, binding = 5) buffer splat_block
{
    vec4 splat[];
};
layout(std430, set = 0, binding = 6) writeonly buffer tile_block
{
    uint tile[];
};
layout(std430, set = 0, binding = 7) writeonly buffer slot_block
{
    uint slot[];
};
layout(std430, set = 0, binding = 8) writeonly buffer owner_block
{
    uint owner[];
};
layout(std430, set = 0, binding = 9) writeonly buffer record_block
{
    float record[];
};

outline outline_of(uint i)
{
    const vec4 a = splat[3 * i], b = splat[3 * i + 1], c = splat[3 * i + 2];
    const uint x = floatBitsToUint(c.y), y = floatBitsToUint(c.z);

    return outline(a.xy, a.z, a.w, b.x, b.y, uvec2(x & 0xffff, x >> 16),
                   uvec2(y & 0xffff, y >> 16));
}

void main()
{
    const uint rank = thread_index();
    uint i, at, end;
    outline o;

    if (rank >= f.n || total[IS_FULL] != 0)
        return;
    i = order[rank];
    at = offset[rank];
    end = at + count[i];
    splat[3 * i + 2].w = uintBitsToFloat(at);
    if (at == end)
        return;
    o = outline_of(i);
    for (uint row = o.y[0] / TILE; row * TILE < o.y[1]; row++) {
        const uvec2 c = tile_columns(o, row);

        for (uint k = c[0]; k < c[1] && at < end; k++, at++) {
            tile[at] = row * f.n_tiles_x + k;
            slot[at] = at;
            owner[at] = i;
        }
    }
    /* Pairs that were counted but not found belong to no tile. */
    for (; at < end; at++) {
        tile[at] = f.n_tiles_x * f.n_tiles_y;
        slot[at] = at;
        owner[at] = i;
        for (uint k = 0; k < N_SUMS; k++)
            record[N_SUMS * at + k] = 0;
    }
}
