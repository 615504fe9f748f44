/* SPDX-License-Identifier: MIT */
#include "splat_animate.h"

#include "model.h"

#include <tgmath.h>

#define PEAK R(SAGA_PEAK_LOG2)
#define LOG2_E R(1.4426950408889634)
#define LN_2 R(0.6931471805599453)
/* Limit of |dt| / width, as in docs/arithmetic.md. */
#define LIMIT_U R(16)
#define LIMIT_AGE R(4) /* limit of the age */

/* Returns log2(1 + 2^x), without overflow, and precise for small 2^x. */
static real softplus2(real x)
{
    const real e = exp2(-fabs(x));

    return (x > 0 ? x : 0) + LOG2_E * log1p(e);
}

static real elapsed(const saga_splat_params *p, size_t i, real t)
{
    return p->t_centre ? t - p->t_centre[i] : t;
}

/* Returns |dt| / width, limited. NaN stays NaN. dt = 0 gives 0 for every width,
 * even if 2^-width is infinite. */
static real width_ratio(const saga_splat_params *p, size_t i, real dt)
{
    const real u = dt == 0 ? 0 : fabs(dt) * exp2(-p->log2_width[i]);

    return u > LIMIT_U ? LIMIT_U : u;
}

static bool is_short(const saga_splat_params *p, size_t i)
{
    return p->log2_width && p->log2_width[i] < -1;
}

real saga_splat_ageing(const saga_splat_params *p, size_t i)
{
    return is_short(p, i) ? exp2(fmin(-p->log2_width[i], R(100))) : 2;
}

static void animate_mean(real *out, const saga_splat_params *p, size_t i,
                         real age)
{
    size_t a;

    for (a = 0; a < 3; a++) {
        const real *const b = p->motion ? p->motion + 9 * i + a : NULL;
        const real support = p->support ? p->support[3 * i + a] : 1;

        out[a] = p->mean[3 * i + a];
        if (b)
            /* The place is mean + support (b1 age + b2 age^2 + b3 age^3). */
            out[a] += support * (((b[6] * age + b[3]) * age + b[0]) * age);
    }
}

static real age_of(const saga_splat_params *p, size_t i, real dt)
{
    return saga_clamp(dt * saga_splat_ageing(p, i), -LIMIT_AGE, LIMIT_AGE);
}

void saga_splat_place(real x[3], const saga_splat_params *p, size_t i, real t)
{
    animate_mean(x, p, i, age_of(p, i, elapsed(p, i, t)));
}

void saga_splat_animate_forward(saga_splat_posed *out,
                                const saga_splat_params *p, saga_range of,
                                real t)
{
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        const real dt = elapsed(p, i, t);
        const real age = age_of(p, i, dt);
        size_t a;

        animate_mean(out->mean + 3 * i, p, i, age);
        for (a = 0; a < 4; a++) {
            out->quat[4 * i + a] = p->quat[4 * i + a];
            if (p->slope)
                out->quat[4 * i + a] += p->slope[4 * i + a] * age;
        }
        /* An opacity o means alpha = 8 / (1 + 2^(3 - o)); q0 is its -log2. */
        out->q0[i] = softplus2(PEAK - p->opacity[i]) - PEAK;
        if (p->log2_width) {
            const real u = width_ratio(p, i, dt);

            /* Alpha falls by exp(-u^2) with the time from the centre. */
            out->q0[i] += LOG2_E * u * u;
        }
    }
}

/* Returns dL/dage through the motion. */
static real motion_backward(saga_splat_params *d, const real *d_mean,
                            const saga_splat_params *p, size_t i, real age)
{
    real d_age = 0;
    size_t a;

    if (!p->motion)
        return 0;
    for (a = 0; a < 3; a++) {
        const real *const b = p->motion + 9 * i + a;
        const real support = p->support ? p->support[3 * i + a] : 1;
        const real s = support * d_mean[a];

        /* The mean moves by s p(age), p = b1 age + b2 age^2 + b3 age^3, so that
         * dL/db_k = s dL/dmean age^k and dL/dage = s dL/dmean p'(age). */
        if (d->motion) {
            real *const db = d->motion + 9 * i + a;

            db[0] += s * age;
            db[3] += s * (age * age);
            db[6] += s * (age * age * age);
        }
        if (d->support)
            d->support[3 * i + a] += d_mean[a] *
                                     (((b[6] * age + b[3]) * age + b[0]) * age);
        d_age += s * ((3 * b[6] * age + 2 * b[3]) * age + b[0]);
    }
    return d_age;
}

/* Returns dL/dage through the rotation. */
static real quat_backward(saga_splat_params *d, const real *d_quat,
                          const saga_splat_params *p, size_t i, real age)
{
    real d_age = 0;
    size_t a;

    for (a = 0; a < 4; a++) {
        d->quat[4 * i + a] += d_quat[a];
        if (!p->slope)
            continue;
        if (d->slope)
            d->slope[4 * i + a] += d_quat[a] * age;
        d_age += d_quat[a] * p->slope[4 * i + a];
    }
    return d_age;
}

/* Returns dL/dage. */
static real pose_backward(saga_splat_params *d, const saga_splat_posed *d_out,
                          const saga_splat_params *p, size_t i, real age)
{
    size_t a;

    for (a = 0; a < 3; a++)
        d->mean[3 * i + a] += d_out->mean[3 * i + a];
    return motion_backward(d, d_out->mean + 3 * i, p, i, age) +
           quat_backward(d, d_out->quat + 4 * i, p, i, age);
}

/* Adds the gradients of opacity and width. d log2(1 + 2^(3 - o)) / do = -1 / (1
 * + 2^(o - 3)). With u = |dt| / width below its limit, q = log2(e) u^2 gives
 * dq/d log2_width = -2 u^2 and dq/ddt = 2 log2(e) u^2 / dt. Returns dL/ddt. */
static real opacity_backward(saga_splat_params *d, real d_q0,
                             const saga_splat_params *p, size_t i, real dt)
{
    real u;

    d->opacity[i] -= d_q0 / (1 + exp2(p->opacity[i] - PEAK));
    if (!p->log2_width)
        return 0;
    u = width_ratio(p, i, dt);
    if (u >= LIMIT_U)
        return 0;
    if (d->log2_width)
        d->log2_width[i] -= 2 * u * u * d_q0;
    return dt == 0 ? 0 : d_q0 * 2 * LOG2_E * u * u / dt;
}

void saga_splat_animate_backward(saga_splat_params *d, const saga_canvas *c,
                                 const saga_splat_params *p, saga_range of)
{
    const saga_splat_posed *const d_out = &c->splat.d_posed;
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        const real dt = elapsed(p, i, c->t);
        const real pace = saga_splat_ageing(p, i), age = dt * pace;
        real d_dt, d_age;

        /* A primitive that is not drawn has no gradient. */
        if (c->splat.extent[i] == 0)
            continue;
        d_age = pose_backward(d, d_out, p, i,
                              saga_clamp(age, -LIMIT_AGE, LIMIT_AGE));
        d_dt = opacity_backward(d, d_out->q0[i], p, i, dt);
        /* age = pace dt, and below a width of 1/2 pace = 2^-log2_width. At its
         * limit the age is constant, and no gradient passes. */
        if (!c->rules.detach_time && fabs(age) < LIMIT_AGE) {
            d_dt += pace * d_age;
            if (d->log2_width && is_short(p, i))
                d->log2_width[i] -= LN_2 * age * d_age;
        }
        /* dt = t - t_centre */
        if (d->t_centre)
            d->t_centre[i] -= d_dt;
    }
}
