/* SPDX-License-Identifier: MIT
 *
 * Adds the records of each of the pass's own primitives and takes them back to
 * its attributes: splat_project.c and splat_animate.c, backward. SETS the
 * gradients, and adds to the statistics. */
#version 450
#extension GL_GOOGLE_include_directive : require
#include "frame_buffer.glsl"

layout(std430, set = 0, binding = 1) readonly buffer total_block
{
    uint total[];
};
layout(std430, set = 0, binding = 2) readonly buffer value_block
{
    float value[];
};
layout(std430, set = 0, binding = 3) readonly buffer splat_block
{
    vec4 splat[];
};
layout(std430, set = 0, binding = 4) readonly buffer count_block
{
    uint count[];
};
layout(std430, set = 0, binding = 5) readonly buffer record_block
{
    float record[];
};
layout(std430, set = 0, binding = 6) writeonly buffer grad_block
{
    float grad[]; /* as value */
};
layout(std430, set = 0, binding = 7) buffer stat_block
{
    float stat[]; /* (n_own, 3): grad2d, weight, seen */
};
layout(std430, set = 0, binding = 8) writeonly buffer d_q0_block
{
    float d_q0[]; /* (n_own) */
};

float load(uint i, uint attr, uint at)
{
    return value[f.attr_at[attr] + f.attr_width[attr] * i + at];
}

bool has(uint i, uint attr)
{
    return (f.attrs >> attr & 1) != 0;
}

void store(uint i, uint attr, uint at, float x)
{
    grad[f.attr_at[attr] + f.attr_width[attr] * i + at] = x;
}

void store3(uint i, uint attr, uint at, vec3 x)
{
    for (uint k = 0; k < 3; k++)
        store(i, attr, at + k, x[k]);
}

void store4(uint i, uint attr, vec4 x)
{
    for (uint k = 0; k < 4; k++)
        store(i, attr, k, x[k]);
}

#include "primitive.glsl"

/* --- Sums of the records ------------------------------------------------- */

/* A primitive with more records than MANY is added by the whole group: one
 * thread alone would keep the others waiting. */
const uint MANY = 128;

shared float part[N_SUMS][THREADS];
shared uint many[THREADS];

/* Adds the records of primitive `of`, whose first slot is `slot`; thread k
 * every 128th from k on, then halves are added to halves. */
void add_together(uint slot, uint n)
{
    const uint k = gl_LocalInvocationIndex;

    for (uint j = 0; j < N_SUMS; j++)
        part[j][k] = 0;
    for (uint r = k; r < n; r += THREADS)
        for (uint j = 0; j < N_SUMS; j++)
            part[j][k] += record[(slot + r) * N_SUMS + j];
    barrier();
    for (uint half_n = THREADS / 2; half_n > 0; half_n /= 2) {
        for (uint j = 0; k < half_n && j < N_SUMS; j++)
            part[j][k] += part[j][k + half_n];
        barrier();
    }
}

uint slot_of(uint i)
{
    return floatBitsToUint(splat[3 * i + 2].w);
}

void gather(out float sum[N_SUMS], uint i)
{
    const uint k = gl_LocalInvocationIndex;
    const uint n = i < f.n_own ? count[i] : 0;
    const uint first = i - k;

    for (uint j = 0; j < N_SUMS; j++)
        sum[j] = 0;
    many[k] = n > MANY ? n : 0;
    barrier();
    for (uint of = 0; of < THREADS; of++)
        if (many[of] > 0) {
            add_together(slot_of(first + of), many[of]);
            if (k == of)
                for (uint j = 0; j < N_SUMS; j++)
                    sum[j] = part[j][0];
            barrier();
        }
    if (n > 0 && n <= MANY)
        for (uint r = slot_of(i); r < slot_of(i) + n; r++)
            for (uint j = 0; j < N_SUMS; j++)
                sum[j] += record[r * N_SUMS + j];
    for (uint j = 0; j < 6; j++)
        sum[j] *= LN_2;
}

/* --- From the splat to the pose ------------------------------------------ */

struct splat_gradient {
    vec2 mean;
    float g, n, h, q0;
};

/* Gradients of the rows of T. */
mat2x3 conic_backward(splat_gradient d, float g, float n, shape s)
{
    const covariance v = covariance_of(s);
    const float h = sqrt(K / v.c);
    const float d_g = d.g + d.n * (v.b / v.c);
    const float d_b = d.n * g / v.c;
    const float d_c = (d_g * g / 2 - d.n * n - d.h * h / 2) / v.c;
    const float d_det = -d_g * g / (2 * v.det);
    mat2x3 dt;

    dt[0] = 2 * d_det * (cross(s.t[1], v.across) + f.low_pass * s.t[0]) +
            d_b * s.t[1];
    dt[1] = 2 * d_det * (cross(v.across, s.t[0]) + f.low_pass * s.t[1]) +
            d_b * s.t[0] + 2 * d_c * s.t[1];
    return dt;
}

vec4 rotation_backward(mat3 dr, shape s)
{
    const vec4 q = s.quat;
    vec4 d;

    d[0] = 2 * (q[1] * (dr[2][1] - dr[1][2]) + q[2] * (dr[0][2] - dr[2][0]) +
                q[3] * (dr[1][0] - dr[0][1]));
    d[1] = 2 * (q[0] * (dr[2][1] - dr[1][2]) + q[2] * (dr[0][1] + dr[1][0]) +
                q[3] * (dr[0][2] + dr[2][0]) -
                2 * q[1] * (dr[1][1] + dr[2][2]));
    d[2] = 2 * (q[0] * (dr[0][2] - dr[2][0]) + q[1] * (dr[0][1] + dr[1][0]) +
                q[3] * (dr[1][2] + dr[2][1]) -
                2 * q[2] * (dr[0][0] + dr[2][2]));
    d[3] = 2 * (q[0] * (dr[1][0] - dr[0][1]) + q[1] * (dr[0][2] + dr[2][0]) +
                q[2] * (dr[1][2] + dr[2][1]) -
                2 * q[3] * (dr[0][0] + dr[1][1]));
    return (d - dot(q, d) * q) * s.quat_recip;
}

/* Returns the gradient of the quaternion; sets those of the scales, and of the
 * rows of J W. */
vec4 shape_backward(out vec3 d_scale, out mat2x3 d_row, mat2x3 dt, shape s,
                    vec3 log2_scale)
{
    mat2x3 du;
    mat3 dr;

    for (uint j = 0; j < 3; j++)
        d_scale[j] = abs(log2_scale[j]) <= SCALE_MAX
                         ? LN_2 * (dt[0][j] * s.t[0][j] + dt[1][j] * s.t[1][j])
                         : 0;
    du[0] = dt[0] * s.scale;
    du[1] = dt[1] * s.scale;
    for (uint i = 0; i < 3; i++) {
        dr[i] = s.row[0][i] * du[0] + s.row[1][i] * du[1];
        d_row[0][i] = dot(s.r[i], du[0]);
        d_row[1][i] = dot(s.r[i], du[1]);
    }
    return rotation_backward(dr, s);
}

vec3 mean_backward(vec2 d_mean, mat2x3 d_row, shape s)
{
    const float z = s.view.z;
    vec3 dv = vec3(0), d;

    for (int i = 0; i < 2; i++) {
        const float focal = f.focal[i] / z;
        float d_ratio = f.focal[i] * d_mean[i];

        if (s.slope[i] == s.ratio[i])
            d_ratio -= focal * dot(camera_axis(2), d_row[i]);
        dv[i] = d_ratio / z;
        dv.z -= (dot(s.row[i], d_row[i]) + d_ratio * s.ratio[i]) / z;
    }
    d = camera_axis(0) * dv.x + camera_axis(1) * dv.y + camera_axis(2) * dv.z;
    return d;
}

/* --- From the pose to the attributes ------------------------------------- */

/* Returns dL/dage through the motion. */
float motion_backward(uint i, vec3 d_mean, float age)
{
    vec3 support = vec3(1), s;

    if (!has(i, MOTION))
        return 0;
    if (has(i, SUPPORT)) {
        support = load3(i, SUPPORT, 0);
        store3(i, SUPPORT, 0,
               d_mean * (((load3(i, MOTION, 6) * age + load3(i, MOTION, 3)) *
                              age + load3(i, MOTION, 0)) * age));
    }
    s = support * d_mean;
    store3(i, MOTION, 0, s * age);
    store3(i, MOTION, 3, f.order < 2 ? vec3(0) : s * (age * age));
    store3(i, MOTION, 6, f.order < 3 ? vec3(0) : s * (age * age * age));
    return dot(s, (3 * load3(i, MOTION, 6) * age + 2 * load3(i, MOTION, 3)) *
                          age + load3(i, MOTION, 0));
}

void animate_backward(uint i, posed p, vec3 d_mean, vec4 d_quat, float d_q0)
{
    const bool is_wide = has(i, LOG2_WIDTH);
    float d_age = motion_backward(i, d_mean, p.limited), d_dt = 0, d_width = 0;

    store3(i, MEAN, 0, d_mean);
    store4(i, QUAT, d_quat);
    if (has(i, SLOPE)) {
        store4(i, SLOPE, d_quat * p.limited);
        d_age += dot(d_quat, load4(i, SLOPE));
    }
    store(i, OPACITY, 0, -d_q0 / (1 + exp2(load(i, OPACITY, 0) - PEAK)));
    if (is_wide && p.u < LIMIT_U) {
        d_width = -2 * p.u * p.u * d_q0;
        d_dt = p.dt == 0 ? 0 : d_q0 * 2 * LOG2_E * p.u * p.u / p.dt;
    }
    if (f.detach_time == 0 && abs(p.age) < LIMIT_AGE) {
        d_dt += p.pace * d_age;
        if (is_short(i))
            d_width -= LN_2 * p.age * d_age;
    }
    if (is_wide)
        store(i, LOG2_WIDTH, 0, d_width);
    if (has(i, T_CENTRE))
        store(i, T_CENTRE, 0, -d_dt);
}

void clear(uint i)
{
    for (uint a = 0; a < N_ATTRS; a++)
        for (uint k = 0; has(i, a) && k < f.attr_width[a]; k++)
            store(i, a, k, 0);
    d_q0[i] = 0;
}

void main()
{
    const uint i = thread_index();
    const bool is_own = i < f.n_own && total[IS_FULL] == 0;
    float sum[N_SUMS];
    vec4 a, b;
    splat_gradient d;
    posed p;
    shape s;
    mat2x3 d_row = mat2x3(0);
    vec4 d_quat = vec4(0);
    vec3 d_scale = vec3(0), log2_scale;

    if (total[IS_FULL] != 0)
        return;
    gather(sum, i);
    if (!is_own)
        return;
    clear(i);
    /* A primitive that is not visible has no pixels. */
    if (floatBitsToUint(splat[3 * i + 2].y) == 0)
        return;
    a = splat[3 * i];
    b = splat[3 * i + 1];
    d.q0 = sum[0];
    d.g = 2 * sum[2];
    d.n = -2 * sum[3];
    d.h = 2 * b.x * sum[5];
    d.mean = vec2(-2 * a.z * sum[1], 2 * a.w * sum[1] - 2 * b.x * b.x * sum[4]);
    p = animate(i);
    if (!project_mean(s, p.mean))
        return;
    log2_scale = load3(i, LOG2_SCALE, 0);
    project_shape(s, p.quat, log2_scale);
    if (s.shrink == 1)
        d_quat = shape_backward(d_scale, d_row,
                                conic_backward(d, a.z, a.w, s), s, log2_scale);
    store3(i, LOG2_SCALE, 0, d_scale);
    store3(i, COLOUR, 0, vec3(sum[6], sum[7], sum[8]));
    animate_backward(i, p, mean_backward(d.mean, d_row, s), d_quat, d.q0);
    d_q0[i] = d.q0;
    stat[3 * i] += length(d.mean);
    stat[3 * i + 1] += sum[9];
    stat[3 * i + 2] += 1;
}
