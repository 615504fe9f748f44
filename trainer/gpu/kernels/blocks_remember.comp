/* SPDX-License-Identifier: MIT
 *
 * Keeps the gradients of a group of blocks, and every fifth step adds those
 * kept to the covariances: block_adam.c, remember(). */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "blocks.glsl"

shared float now[MOST * LANES]; /* the gradients of this step */

void take(uint lane, uint part, uint block)
{
    uint n;
    const uint begin = begin_of(n, block);
    bool is_sound = true;

    for (uint k = part; k < width; k += PARTS) {
        const float x = k < n ? g[begin + k] : 0;

        is_sound = is_sound && is_finite(x);
        now[k * LANES + lane] = x;
    }
    if (!is_sound)
        atomicOr(flag[IS_UNSOUND], 1u);
}

/* Returns number k of the gradients that were kept as number p. */
float kept(uint recent, uint p, uint k, uint lane)
{
    return p == RECENT - 1 ? now[k * LANES + lane]
                           : state[recent + (p * width + k) * LANES + lane];
}

void main()
{
    const uint group = group_index();
    const uint lane = gl_LocalInvocationIndex % LANES;
    const uint part = gl_LocalInvocationIndex / LANES;
    const uint slot = (number + first_of(group) + RECENT - 1) % RECENT;
    const uint recent = recent_of(group), c_at = covariance_of(group);
    const float rest2 = 1 - beta2;

    if (group >= n_groups || flag[IS_IDLE] != 0)
        return;
    take(lane, part, first_of(group) + lane * APART);
    barrier();
    for (uint k = part; k < width; k += PARTS)
        state[recent + (slot * width + k) * LANES + lane] =
            now[k * LANES + lane];
    if (slot < RECENT - 1)
        return;
    for (uint k = part; k < width; k += PARTS) {
        float scaled[RECENT];

        for (uint p = 0; p < RECENT; p++)
            scaled[p] = rest2 * kept(recent, p, k, lane);
        for (uint l = 0; l < width; l++) {
            const uint at = c_at + (k * width + l) * LANES + lane;
            float c = state[at];

            for (uint p = 0; p < RECENT; p++)
                c = c * beta2 + scaled[p] * kept(recent, p, l, lane);
            state[at] = c;
        }
    }
}
