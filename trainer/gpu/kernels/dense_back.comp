/* SPDX-License-Identifier: MIT
 *
 * A layer's gradients back to its inputs: a thread for each input of a row. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "dense.glsl"

layout(std430, set = 0, binding = 0) readonly buffer dy_block
{
    float dy[]; /* (n_rows, n_out) */
};
layout(std430, set = 0, binding = 1) readonly buffer param_block
{
    float param[];
};
layout(std430, set = 0, binding = 2) readonly buffer x_block
{
    float x[]; /* (n_rows, n_in) */
};
layout(std430, set = 0, binding = 3) buffer dx_block
{
    float dx[]; /* (n_rows, n_cols) */
};

void main()
{
    const uint k = thread_index(), row = k / n_cols, i = k % n_cols;
    float sum = 0;

    if (row >= n_rows)
        return;
    for (uint o = 0; o < n_out; o++)
        sum += dy[row * n_out + o] * param[at + o * n_in + i];
    if ((how & RELU) != 0 && !(x[row * n_in + i] > 0))
        sum = 0;
    dx[k] = (how & ADD) != 0 ? dx[k] + sum : sum;
}
