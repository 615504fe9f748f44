/* SPDX-License-Identifier: MIT
 *
 * Adam's step of a group of blocks along their axes: block_adam.c, step_group()
 * after the turn. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "blocks.glsl"

layout(std430, set = 0, binding = 4) buffer x_block
{
    float x[]; /* (n_blocks, stride) */
};

shared float now[MOST * LANES]; /* the gradients */
shared float pace[MOST * LANES]; /* steps along the axes */

/* Returns the gradient along axis k. */
float look_along(uint at, uint lane)
{
    vec4 sum = vec4(0);

    for (uint i = 0; i < width; i += 4)
        for (uint k = 0; k < 4; k++)
            sum[k] += state[at + (i + k) * LANES + lane] *
                      now[(i + k) * LANES + lane];
    return (sum.x + sum.y) + (sum.z + sum.w);
}

/* Returns the step along an axis with the gradient r, and updates its moments.
 * A turn has computed v from the covariance, which has this gradient. */
float step_along(uint m_at, uint v_at, float r, bool turned)
{
    float v = state[v_at], sigma, m;

    if (!turned) {
        v = beta2 * v + (1 - beta2) * r * r;
        state[v_at] = v;
    }
    sigma = sqrt(max(v, 0) / c2) + eps;
    r = clamp(r, -most * sigma, most * sigma);
    m = beta1 * state[m_at] + (1 - beta1) * r;
    state[m_at] = m;
    return -rate * m / (c1 * sigma);
}

void main()
{
    const uint group = group_index();
    const uint lane = gl_LocalInvocationIndex % LANES;
    const uint part = gl_LocalInvocationIndex / LANES;
    const uint block = first_of(group) + lane * APART;
    const bool turned = (number + first_of(group)) % APART == 0;
    bool is_sound = true;
    uint n, begin;

    if (group >= n_groups || flag[IS_IDLE] != 0)
        return;
    begin = begin_of(n, block);
    for (uint k = part; k < width; k += PARTS)
        now[k * LANES + lane] = k < n ? g[begin + k] : 0;
    barrier();
    for (uint k = part; k < width; k += PARTS) {
        const uint at = k * LANES + lane;
        const float r = look_along(axes_of(group) + k * width * LANES, lane);

        pace[at] = step_along(m_of(group) + at, v_of(group) + at, r, turned);
    }
    barrier();
    for (uint l = part; l < n; l += PARTS) {
        float sum = x[begin + l];

        for (uint k = 0; k < width; k++)
            sum += pace[k * LANES + lane] *
                   state[axes_of(group) + (k * width + l) * LANES + lane];
        is_sound = is_sound && is_finite(sum);
        x[begin + l] = sum;
    }
    if (!is_sound)
        atomicOr(flag[IS_UNSOUND], 1u);
}
