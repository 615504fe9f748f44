/* SPDX-License-Identifier: MIT
 *
 * Adds up the gradients of primitives' positions and of log2 supports, sets
 * those of F_fine's outputs, and does Adam's step of positions:
 * scene/twin_backward.c, loss_chunk(), shift_backward() and fine_outputs();
 * entropy/rate_values.c, saga_rate_learn_offset(); nn/adam.c. A thread for each
 * output of an anchor. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "group.glsl"

layout(push_constant) uniform push_block
{
    uint n;
    uint n_features;
    float least_x; /* bounds of log2 supports */
    float least_t;
    float most;    /* of offsets, in supports */
    float price;   /* of an anchor's distance */
    float beta1;
    float beta2;
    float eps;
    float most_step;
    float rate;    /* over 1 - beta1^step */
    float scale;   /* 1 / sqrt(1 - beta2^step) */
};

layout(std430, set = 0, binding = 0) readonly buffer d_feature_block
{
    float d_feature[]; /* (n, n_features) */
};
layout(std430, set = 0, binding = 1) readonly buffer d_place_block
{
    float d_place[]; /* (n, 4) of the picture */
};
layout(std430, set = 0, binding = 2) readonly buffer d_log2_block
{
    float d_log2[]; /* (n, 4) of the picture */
};
layout(std430, set = 0, binding = 3) readonly buffer d_offset_block
{
    float d_offset[]; /* (n, 4) of the rate */
};
layout(std430, set = 0, binding = 4) readonly buffer shift_block
{
    float shift[]; /* (n, 4) of noise or rounding */
};
layout(std430, set = 0, binding = 5) readonly buffer anchor_block
{
    float anchor[];
};
layout(std430, set = 0, binding = 6) readonly buffer support_block
{
    float support[];
};
layout(std430, set = 0, binding = 7) readonly buffer log2_block
{
    float log2_of[];
};
layout(std430, set = 0, binding = 8) readonly buffer offset_block
{
    float offset[];
};
layout(std430, set = 0, binding = 9) writeonly buffer d_out_block
{
    float d_outputs[]; /* (n, n_features + 4) */
};
layout(std430, set = 0, binding = 10) buffer x_block
{
    float x[]; /* (n, 4), then both moments */
};
layout(std430, set = 0, binding = 11) buffer flag_block
{
    uint flag[];
};

const uint IS_UNSOUND = 0, IS_IDLE = 1; /* blocks.glsl */
const float LN_2 = 0.69314718055994531;

void adam(uint k, float g)
{
    const uint m_at = 4 * n + k, v_at = 8 * n + k;
    const float v = beta2 * x[v_at] + (1 - beta2) * g * g;
    const float sigma = sqrt(v) * scale + eps;
    const float near = clamp(g, -most_step * sigma, most_step * sigma);
    const float m = beta1 * x[m_at] + (1 - beta1) * near;
    const float to = x[k] - rate * m / sigma;

    x[k] = to;
    x[m_at] = m;
    x[v_at] = v;
    if (!is_finite(to) || !is_finite(g))
        atomicOr(flag[IS_UNSOUND], 1u);
}

void main()
{
    const uint at = thread_index(), width = n_features + 4;
    const uint i = at / width, c = at % width, k = 4 * i + c - n_features;
    const float least = c == width - 1 ? least_t : least_x;
    float o, over, d_x, d_l;

    if (i >= n)
        return;
    if (c < n_features) {
        d_outputs[at] = d_feature[i * n_features + c];
        return;
    }
    o = (x[k] + shift[k] - anchor[k]) / support[k];
    over = o > 1 ? o - 1 : o < -1 ? o + 1 : 0;
    d_x = d_place[k] + 2 * price * over / support[k];
    d_l = d_log2[k] - 2 * price * over * o * LN_2;
    if (abs(offset[k]) < most) {
        d_x += d_offset[k] / support[k];
        d_l -= d_offset[k] * offset[k] * LN_2;
    }
    /* Noise and rounding shift a position by a part of its support. */
    d_l += d_x * shift[k] * LN_2;
    d_outputs[at] = log2_of[k] < 0 && log2_of[k] > least ? d_l : 0;
    if (flag[IS_IDLE] == 0)
        adam(k, d_x);
}
