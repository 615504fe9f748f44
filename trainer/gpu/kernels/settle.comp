/* SPDX-License-Identifier: MIT
 *
 * What follows Adam's steps: means move, values are clamped, paths are kept,
 * and what each primitive is worth is noted; warm/flat.c: settle. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "axes.glsl"

layout(std430, set = 0, binding = 1) readonly buffer total_block
{
    uint total[];
};
layout(std430, set = 0, binding = 2) buffer value_block
{
    float value[];
};
layout(std430, set = 0, binding = 3) readonly buffer carry_block
{
    float carry[];
};
layout(std430, set = 0, binding = 4) readonly buffer d_q0_block
{
    float d_q0[];
};
layout(std430, set = 0, binding = 5) buffer worth_block
{
    float worth[];
};

const float MOST_STEP = 2; /* octaves by which size changes a step */

void take_step(uint i)
{
    const uint mean_at = f.attr_at[MEAN] + 3 * i;
    const uint quat_at = f.attr_at[QUAT] + 4 * i;
    const uint size_at = f.attr_at[LOG2_SCALE] + 3 * i;
    const float typical = uintBitsToFloat(total[TYPICAL]);
    const mat3 axes = axes_of(vec4(value[quat_at], value[quat_at + 1],
                                   value[quat_at + 2], value[quat_at + 3]));

    for (uint k = 0; k < 3; k++) {
        const float taken = carry[5 * i + k] *
                            exp2(clamp(value[size_at + k] - typical, -MOST_STEP,
                                       MOST_STEP));

        for (uint j = 0; j < 3; j++)
            value[mean_at + j] += taken * axes[k][j];
    }
}

bool has(uint attr)
{
    return (f.attrs >> attr & 1) != 0;
}

void bound(uint i, uint a)
{
    for (uint k = 0; has(a) && k < f.attr_width[a]; k++) {
        const uint at = f.attr_at[a] + f.attr_width[a] * i + k;

        value[at] = clamp(value[at], f.lo[a], f.hi[a]);
    }
}

float ageing(float log2_width)
{
    return log2_width >= -1 ? 2 : exp2(-log2_width);
}

/* warm/flat_set.c: saga_flat_keep_path. */
void keep_path(uint i)
{
    const float then = ageing(carry[5 * i + 4]);
    const float ratio = then / ageing(value[f.attr_at[LOG2_WIDTH] + i]);
    const float late = (value[f.attr_at[T_CENTRE] + i] - carry[5 * i + 3]) *
                       then;
    const uint quat_at = f.attr_at[QUAT] + 4 * i;
    const uint slope_at = f.attr_at[SLOPE] + 4 * i;

    if (ratio == 1 && late == 0)
        return;
    for (uint a = 0; a < 3; a++) {
        const uint at = f.attr_at[MOTION] + 9 * i + a;
        const float b1 = value[at], b2 = value[at + 3], b3 = value[at + 6];

        value[f.attr_at[MEAN] + 3 * i + a] += ((b3 * late + b2) * late + b1) *
                                              late;
        value[at] = ratio * ((3 * b3 * late + 2 * b2) * late + b1);
        value[at + 3] = ratio * ratio * (3 * b3 * late + b2);
        value[at + 6] = ratio * ratio * ratio * b3;
    }
    for (uint a = 0; has(SLOPE) && a < 4; a++) {
        value[quat_at + a] += late * value[slope_at + a];
        value[slope_at + a] *= ratio;
    }
}

void main()
{
    const uint i = thread_index();
    const float mse = uintBitsToFloat(total[SQUARES]) / f.n_seen;
    float g;

    if (i >= f.n_own || total[IS_FULL] != 0)
        return;
    take_step(i);
    bound(i, T_CENTRE);
    bound(i, LOG2_WIDTH);
    if (has(T_CENTRE))
        keep_path(i);
    for (uint a = 0; a < N_ATTRS; a++)
        bound(i, a);
    g = -f.n_by_ln_2 * d_q0[i];
    worth[i] += (mse > 0 ? 0.25 / mse : 0) * g * g - g;
}
