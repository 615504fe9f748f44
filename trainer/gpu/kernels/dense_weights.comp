/* SPDX-License-Identifier: MIT
 *
 * The gradients of a layer's weights and biases by one slab of rows, which is
 * one group; dense_sum.comp adds the slabs. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "dense.glsl"

layout(std430, set = 0, binding = 0) readonly buffer x_block
{
    float x[]; /* (n_rows, n_in) */
};
layout(std430, set = 0, binding = 1) readonly buffer dy_block
{
    float dy[]; /* (n_rows, n_out) */
};
layout(std430, set = 0, binding = 2) writeonly buffer partial_block
{
    float partial[]; /* (n_slabs, n_params) */
};

void main()
{
    const uint group = group_index(), n_weights = n_out * n_in;
    const uint begin = group * slab, end = min(begin + slab, n_rows);

    if (group >= n_slabs)
        return;
    for (uint k = gl_LocalInvocationIndex; k < n_weights + n_out;
         k += THREADS) {
        const bool is_bias = k >= n_weights;
        /* A layer without inputs has only biases. */
        const uint cols = max(n_in, 1), i = is_bias ? 0 : k % cols;
        const uint o = is_bias ? k - n_weights : k / cols;
        float sum = 0;

        for (uint row = begin; row < end; row++)
            sum += dy[row * n_out + o] * (is_bias ? 1 : x[row * n_in + i]);
        partial[group * n_params + at - base + k] = sum;
    }
}
