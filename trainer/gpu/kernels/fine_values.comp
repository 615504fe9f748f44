/* SPDX-License-Identifier: MIT
 *
 * Features and supports of fine anchors from the outputs of F_fine, and the
 * sizes by which HYPER knows their primitives' blocks: scene/twin_forward.c,
 * take_fine(), and entropy/rate_context.c, set_size(). A thread for each output
 * of an anchor. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "group.glsl"
#include "exp2_neg.glsl"

layout(push_constant) uniform push_block
{
    uint n;
    uint n_features;
    float least_x; /* bounds of log2 supports */
    float least_t;
};

layout(std430, set = 0, binding = 0) readonly buffer out_block
{
    float outputs[]; /* (n, n_features + 4) */
};
layout(std430, set = 0, binding = 1) readonly buffer level_block
{
    float level[]; /* (n, 2) log2 of half a cell, in space and time */
};
layout(std430, set = 0, binding = 2) writeonly buffer feature_block
{
    float feature[]; /* (n, n_features) */
};
layout(std430, set = 0, binding = 3) writeonly buffer support_block
{
    float support[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 4) writeonly buffer log2_block
{
    float log2_of[]; /* (n, 4) */
};
layout(std430, set = 0, binding = 5) writeonly buffer size_block
{
    float size[]; /* (n, 5) */
};

void main()
{
    const uint k = thread_index(), width = n_features + 4;
    const uint i = k / width, c = k % width, axis = c - n_features;
    const bool is_time = axis == 3;
    float l;

    if (i >= n)
        return;
    if (c < n_features) {
        feature[i * n_features + c] = outputs[k];
        return;
    }
    l = clamp(level[2 * i + (is_time ? 1 : 0)] + outputs[k],
              is_time ? least_t : least_x, 0);
    log2_of[4 * i + axis] = l;
    support[4 * i + axis] = exp2_neg(-l);
    /* 0 stands for 2^-11 half-cubes, or 2^-8 segments. */
    size[5 * i + axis] = (l + (is_time ? 8 : 11)) / 4;
    if (is_time)
        size[5 * i + 4] = 1.0 / 8; /* one primitive */
}
