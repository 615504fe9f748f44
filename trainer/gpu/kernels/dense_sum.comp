/* SPDX-License-Identifier: MIT
 *
 * Adds the slabs' gradients of all parameters, in their order. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "dense.glsl"

layout(std430, set = 0, binding = 0) readonly buffer partial_block
{
    float partial[]; /* (n_slabs, n_params) */
};
layout(std430, set = 0, binding = 1) writeonly buffer sum_block
{
    float sum_of[]; /* of all passes' parameters */
};

void main()
{
    const uint k = thread_index();
    float sum = 0;

    if (k >= n_params)
        return;
    for (uint s = 0; s < n_slabs; s++)
        sum += partial[s * n_params + k];
    sum_of[base + k] = sum;
}
