/* SPDX-License-Identifier: MIT
 *
 * Features with noise of one step, or rounded around their means:
 * train/fit/fit.c, use_features(). A thread for each. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "group.glsl"
#include "rng.glsl"

layout(push_constant) uniform push_block
{
    uint n_blocks;
    uint n_features;
    uint rounds;
    uint key_low;
    uint key_high;
    float step;
};

layout(std430, set = 0, binding = 0) readonly buffer x_block
{
    float x[]; /* (n_blocks, n_features) */
};
layout(std430, set = 0, binding = 1) readonly buffer mu_block
{
    float mu[];
};
layout(std430, set = 0, binding = 2) readonly buffer span_block
{
    uint span[]; /* (n_blocks) first + 256 n of the features that are coded */
};
layout(std430, set = 0, binding = 3) writeonly buffer to_block
{
    float to[];
};

void main()
{
    const uint k = thread_index(), block = k / n_features, i = k % n_features;
    uint begin, n;

    if (block >= n_blocks)
        return;
    begin = span[block] & 255;
    n = span[block] >> 8;
    if (i < begin || i >= begin + n)
        to[k] = x[k];
    else if (rounds != 0)
        to[k] = mu[k] + floor((x[k] - mu[k]) / step + 0.5) * step;
    else
        to[k] = x[k] + step * noise(uvec2(key_low, key_high), uvec2(k, 0));
}
