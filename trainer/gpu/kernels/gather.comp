/* SPDX-License-Identifier: MIT
 *
 * Columns of a network's inputs that blocks give: scene/links.c,
 * saga_links_gather(). A thread for each number. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "rows.glsl"
#include "links.glsl"

layout(std430, set = 0, binding = 1) readonly buffer from_block
{
    float from[]; /* (blocks, have) */
};
layout(std430, set = 0, binding = 2) writeonly buffer x_block
{
    float x[]; /* (n_rows, dim) */
};

float linked(uint block, uint c)
{
    const uint end = link_begin(block + 1);
    float sum = 0;

    for (uint i = link_begin(block); i < end; i++)
        sum += link_weight(i) * from[link_rank(i) * have + c];
    return sum;
}

void main()
{
    const uint k = thread_index(), row = k / n_cols, c = k % n_cols;
    const uint block = first + every * row;
    float sum = 0;

    if (row >= n_rows)
        return;
    if (c < have)
        sum = is_linked != 0 ? linked(block, c) : from[block * have + c];
    x[row * dim + at + c] = clamp(sum, -most, most);
}
