/* SPDX-License-Identifier: MIT
 *
 * Adam's step for all attributes of the warm-up's primitives: nn/adam.c. Steps
 * of means are along the primitive's axes and are only noted, for settle.comp;
 * warm/flat.c: turn_gradients. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"
#include "axes.glsl"

layout(std430, set = 0, binding = 1) buffer total_block
{
    uint total[];
};
layout(std430, set = 0, binding = 2) buffer value_block
{
    float value[];
};
layout(std430, set = 0, binding = 3) readonly buffer grad_block
{
    float grad[];
};
layout(std430, set = 0, binding = 4) buffer m_block
{
    float m[];
};
layout(std430, set = 0, binding = 5) buffer v_block
{
    float v[];
};
layout(std430, set = 0, binding = 6) writeonly buffer carry_block
{
    float carry[]; /* (n, 5): steps of the mean; old t_centre, log2_width */
};
layout(std430, set = 0, binding = 7) writeonly buffer size_block
{
    float size_sum[]; /* (groups) of log2_scale */
};

shared float size_of[THREADS];

/* Returns by how much value `at` falls; updates its moments. */
float step_of(uint at, float g, float rate)
{
    float sigma;

    v[at] = f.beta2 * v[at] + (1 - f.beta2) * (g * g);
    sigma = sqrt(v[at]) * f.scale + f.eps;
    g = clamp(g, -f.most * sigma, f.most * sigma);
    m[at] = f.beta1 * m[at] + (1 - f.beta1) * g;
    return rate * m[at] / sigma;
}

/* Returns the sum of log2_scale after the step. */
float step_primitive(uint i)
{
    const uint mean_at = f.attr_at[MEAN] + 3 * i;
    const uint quat_at = f.attr_at[QUAT] + 4 * i;
    const uint size_at = f.attr_at[LOG2_SCALE] + 3 * i;
    const vec3 world = vec3(grad[mean_at], grad[mean_at + 1],
                            grad[mean_at + 2]);
    const mat3 axes = axes_of(vec4(value[quat_at], value[quat_at + 1],
                                   value[quat_at + 2], value[quat_at + 3]));
    bool is_sound = true;

    if ((f.attrs >> T_CENTRE & 1) != 0) {
        carry[5 * i + 3] = value[f.attr_at[T_CENTRE] + i];
        carry[5 * i + 4] = value[f.attr_at[LOG2_WIDTH] + i];
    }
    for (uint k = 0; k < 3; k++) {
        const float g = dot(axes[k], world);

        is_sound = is_sound && is_finite(g) && is_finite(value[mean_at + k]);
        carry[5 * i + k] = -step_of(mean_at + k, g, f.rate[MEAN]);
    }
    for (uint a = 1; a < N_ATTRS; a++)
        for (uint k = 0; f.rate[a] > 0 && k < f.attr_width[a]; k++) {
            const uint at = f.attr_at[a] + f.attr_width[a] * i + k;

            is_sound = is_sound && is_finite(grad[at]) && is_finite(value[at]);
            value[at] -= step_of(at, grad[at], f.rate[a]);
        }
    if (!is_sound)
        atomicOr(total[IS_UNSOUND], 1u);
    return value[size_at] + value[size_at + 1] + value[size_at + 2];
}

void main()
{
    const uint i = thread_index(), k = gl_LocalInvocationIndex;

    if (total[IS_FULL] != 0)
        return;
    size_of[k] = i < f.n_own ? step_primitive(i) : 0;
    barrier();
    for (uint half_n = THREADS / 2; half_n > 0; half_n /= 2) {
        if (k < half_n)
            size_of[k] += size_of[k + half_n];
        barrier();
    }
    if (k == 0 && i < f.n_own)
        size_sum[group_index()] = size_of[0];
}
