/* SPDX-License-Identifier: MIT
 *
 * A layer forward: a thread for each output of a row. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "dense.glsl"

layout(std430, set = 0, binding = 0) readonly buffer x_block
{
    float x[]; /* (n_rows, n_in) */
};
layout(std430, set = 0, binding = 1) readonly buffer param_block
{
    float param[];
};
layout(std430, set = 0, binding = 2) buffer y_block
{
    float y[]; /* (n_rows, n_out) */
};

void main()
{
    const uint k = thread_index(), row = k / n_out, o = k % n_out;
    const uint w_at = at + o * n_in, x_at = row * n_in;
    float sum;

    if (row >= n_rows)
        return;
    sum = param[at + n_out * n_in + o];
    for (uint i = 0; i < n_in; i++)
        sum += param[w_at + i] * x[x_at + i];
    if ((how & ADD) != 0)
        sum += y[k];
    y[k] = (how & RELU) != 0 ? max(sum, 0) : sum;
}
