/* SPDX-License-Identifier: MIT
 *
 * A primitive at a time and in a camera: the kernels' twin of
 * splat/splat_animate.c and splat/splat_project.c, which explain the formulas.
 * A kernel that includes this has defined load(i, attribute, component) and
 * has(i, attribute). */
#include "exp2_neg.glsl"

const float PEAK = 3;
const float LIMIT_U = 16, LIMIT_AGE = 4;
const float K = 0.72134752044448170; /* log2(e) / 2 */
const float RATIO_MAX = 8, MEAN_MAX = 32768, BORDER = 0.15;
const float SCALE_MAX = 60, ROW_MAX = 1048576;

struct posed {
    float dt, pace, age; /* age = pace dt, not limited */
    float limited;       /* the age, limited */
    float u;             /* |dt| over the width */
    vec3 mean;
    vec4 quat;
    float q0;
};

struct shape {
    vec3 view;
    vec2 ratio, slope, mean; /* mean: in the picture */
    mat2x3 row;              /* row[i] is row i of J W */
    vec4 quat;
    float quat_recip;
    mat3 r; /* r[i] is row i of the rotation */
    vec3 scale;
    mat2x3 t;
    float shrink;
};

struct covariance {
    float a, b, c, det;
    vec3 across;
};

vec3 load3(uint i, uint attr, uint at)
{
    return vec3(load(i, attr, at), load(i, attr, at + 1),
                load(i, attr, at + 2));
}

vec4 load4(uint i, uint attr)
{
    return vec4(load(i, attr, 0), load(i, attr, 1), load(i, attr, 2),
                load(i, attr, 3));
}

/* Returns log2(1 + 2^x). With e = 2^-|x|, ln(1 + e) = 2 artanh(e / (2 + e)),
 * whose argument is at most 1/3: the series is short by less than 1e-8 of it.
 */
float softplus2(float x)
{
    const float e = exp2_neg(min(abs(x), 100)), s = e / (2 + e), q = s * s;
    precise float sum;

    sum = 1.0 / 13;
    sum = fma(sum, q, 1.0 / 11);
    sum = fma(sum, q, 1.0 / 9);
    sum = fma(sum, q, 1.0 / 7);
    sum = fma(sum, q, 1.0 / 5);
    sum = fma(sum, q, 1.0 / 3);
    sum = fma(sum, q, 1);
    return max(x, 0) + 2 * LOG2_E * s * sum;
}

bool is_short(uint i)
{
    return has(i, LOG2_WIDTH) && load(i, LOG2_WIDTH, 0) < -1;
}

posed animate_at(uint i, float t)
{
    posed p;

    p.dt = has(i, T_CENTRE) ? t - load(i, T_CENTRE, 0) : t;
    p.pace = is_short(i) ? exp2(min(-load(i, LOG2_WIDTH, 0), 100)) : 2;
    p.age = p.dt * p.pace;
    p.limited = clamp(p.age, -LIMIT_AGE, LIMIT_AGE);
    p.mean = load3(i, MEAN, 0);
    p.quat = load4(i, QUAT);
    if (has(i, MOTION)) {
        const vec3 support = has(i, SUPPORT) ? load3(i, SUPPORT, 0) : vec3(1);

        p.mean += support * (((load3(i, MOTION, 6) * p.limited +
                               load3(i, MOTION, 3)) * p.limited +
                              load3(i, MOTION, 0)) * p.limited);
    }
    if (has(i, SLOPE))
        p.quat += load4(i, SLOPE) * p.limited;
    p.q0 = softplus2(PEAK - load(i, OPACITY, 0)) - PEAK;
    p.u = 0;
    if (has(i, LOG2_WIDTH)) {
        p.u = p.dt == 0 ? 0 : abs(p.dt) * exp2(-load(i, LOG2_WIDTH, 0));
        p.u = p.u > LIMIT_U ? LIMIT_U : p.u;
        p.q0 += LOG2_E * p.u * p.u;
    }
    return p;
}

posed animate(uint i)
{
    return animate_at(i, f.t);
}

vec3 camera_axis(int i)
{
    return vec3(f.rotation[3 * i], f.rotation[3 * i + 1],
                f.rotation[3 * i + 2]);
}

/* Returns whether the mean can be drawn. */
bool project_mean(inout shape s, vec3 x)
{
    const vec3 d = x - vec3(f.centre[0], f.centre[1], f.centre[2]);

    for (int i = 0; i < 3; i++)
        s.view[i] = dot(camera_axis(i), d);
    if (!(s.view.z >= f.near_plane) || !(s.view.z < FLOAT_MAX))
        return false;
    for (int i = 0; i < 2; i++) {
        const float side = float(i == 0 ? f.width : f.height);
        const float p = f.principal[i], focal = f.focal[i];

        s.ratio[i] = s.view[i] / s.view.z;
        if (!(abs(s.ratio[i]) < RATIO_MAX))
            return false;
        s.mean[i] = p + focal * s.ratio[i];
        if (!(abs(s.mean[i] - side / 2) <= MEAN_MAX))
            return false;
        s.slope[i] = clamp(s.ratio[i], (-BORDER * side - p) / focal,
                           ((1 + BORDER) * side - p) / focal);
    }
    return true;
}

void rotate(inout shape s, vec4 quat)
{
    const float norm2 = dot(quat, quat);
    vec4 q;

    s.quat_recip = norm2 > FLOAT_MIN && norm2 < FLOAT_MAX ? 1 / sqrt(norm2) : 0;
    q = s.quat_recip == 0 ? vec4(1, 0, 0, 0) : quat * s.quat_recip;
    s.quat = q;
    s.r[0] = vec3(1 - 2 * (q[2] * q[2] + q[3] * q[3]),
                  2 * (q[1] * q[2] - q[0] * q[3]),
                  2 * (q[1] * q[3] + q[0] * q[2]));
    s.r[1] = vec3(2 * (q[1] * q[2] + q[0] * q[3]),
                  1 - 2 * (q[1] * q[1] + q[3] * q[3]),
                  2 * (q[2] * q[3] - q[0] * q[1]));
    s.r[2] = vec3(2 * (q[1] * q[3] - q[0] * q[2]),
                  2 * (q[2] * q[3] + q[0] * q[1]),
                  1 - 2 * (q[1] * q[1] + q[2] * q[2]));
}

void project_shape(inout shape s, vec4 quat, vec3 log2_scale)
{
    float top = 0;

    rotate(s, quat);
    s.scale = exp2(clamp(log2_scale, -SCALE_MAX, SCALE_MAX));
    for (int i = 0; i < 2; i++) {
        s.row[i] = f.focal[i] / s.view.z *
                   (camera_axis(i) - s.slope[i] * camera_axis(2));
        /* A row times the rotation's columns. */
        s.t[i] = (s.row[i].x * s.r[0] + s.row[i].y * s.r[1] +
                  s.row[i].z * s.r[2]) * s.scale;
        top = max(top, max(abs(s.t[i].x), max(abs(s.t[i].y), abs(s.t[i].z))));
    }
    s.shrink = top > ROW_MAX ? ROW_MAX / top : 1;
    if (s.shrink < 1) {
        s.t[0] *= s.shrink;
        s.t[1] *= s.shrink;
    }
}

covariance covariance_of(shape s)
{
    const float a0 = dot(s.t[0], s.t[0]), c0 = dot(s.t[1], s.t[1]);
    covariance v;

    v.across = cross(s.t[0], s.t[1]);
    v.a = a0 + f.low_pass;
    v.b = dot(s.t[0], s.t[1]);
    v.c = c0 + f.low_pass;
    v.det = dot(v.across, v.across) + f.low_pass * (a0 + c0) +
            f.low_pass * f.low_pass;
    return v;
}
