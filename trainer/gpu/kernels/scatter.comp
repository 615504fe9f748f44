/* SPDX-License-Identifier: MIT
 *
 * Gradients of a network's inputs back to the blocks that gave them, whose
 * links are those to their readers: scene/links.c, saga_links_scatter(). A
 * thread for each number of a block, which adds its readers in their order. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "rows.glsl"
#include "links.glsl"

layout(std430, set = 0, binding = 1) readonly buffer x_block
{
    float x[]; /* (n_rows, dim) */
};
layout(std430, set = 0, binding = 2) readonly buffer d_x_block
{
    float d_x[]; /* (n_rows, dim) */
};
layout(std430, set = 0, binding = 3) buffer to_block
{
    float to[]; /* (n_blocks, n_cols) */
};

/* Returns the gradient of column c for a block, or 0 if it has no row. */
float gradient(uint block, uint c)
{
    const uint row = (block - first) / every, i = row * dim + at + c;

    return block < first || (block - first) % every != 0
               ? 0
               : inward(d_x[i], x[i], -most, most);
}

float linked(uint block, uint c)
{
    const uint end = link_begin(block + 1);
    float sum = 0;

    for (uint i = link_begin(block); i < end; i++)
        sum += link_weight(i) * gradient(link_rank(i), c);
    return sum;
}

void main()
{
    const uint k = thread_index(), block = k / n_cols, c = k % n_cols;
    float sum;

    if (block >= n_blocks)
        return;
    sum = is_linked != 0 ? linked(block, c) : gradient(block, c);
    to[k] = adds != 0 ? to[k] + sum : sum;
}
