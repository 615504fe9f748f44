/* SPDX-License-Identifier: MIT */
#include "splat_animate.h"

#include "model.h"
#include "splat_lanes.h"

#define PEAK R(SAGA_PEAK_LOG2)
#define LOG2_E R(1.4426950408889634)
#define LN_2 R(0.6931471805599453)
/* Limit of |dt| / width, as in docs/arithmetic.md. */
#define LIMIT_U R(16)
#define LIMIT_AGE R(4) /* limit of the age */

/* Returns log2(1 + 2^x), without overflow, and precise for small 2^x. */
static vec softplus2(vec x)
{
    /* ln(1 + e) = 2 artanh(s), s = e / (2 + e) <= 1/3, by the series of artanh,
     * whose first term that is left out is below 1e-8 (double: 2e-17). */
    enum { TERMS = sizeof(real) == sizeof(double) ? 16 : 8 };
    const vec e = vec_exp2(-vec_abs(x));
    const vec s = e / (2 + e), s2 = s * s;
    vec sum = vec_zero();

    for (int k = TERMS - 1; k >= 0; k--)
        sum = sum * s2 + R(1) / R(2 * k + 1);
    return vec_max(vec_zero(), x) + 2 * LOG2_E * (s * sum);
}

/* --- Time ---------------------------------------------------------------- */

/* The time of primitives. Without a temporal opacity per_width is 0. */
typedef struct {
    vec dt;        /* from the centre */
    vec per_width; /* 1 / width */
    vec pace;      /* as saga_splat_ageing, but for the last bits of its exp2 */
    veci is_short; /* the width is below half a unit */
} timing;

static timing timing_of(const saga_splat_params *p, lanes at, real t)
{
    timing m = { .dt = vec_set1(t), .pace = vec_set1(2) };

    if (p->t_centre)
        m.dt = t - lanes_get(p->t_centre, at);
    if (p->log2_width) {
        const vec log2_width = lanes_get(p->log2_width, at);

        m.per_width = vec_exp2(-log2_width);
        m.is_short = (veci)(log2_width < -1);
        m.pace = vec_select(m.is_short, m.per_width, m.pace);
    }
    return m;
}

/* Returns |dt| / width, limited. NaN stays NaN. */
static vec width_ratio(const timing *m)
{
    return vec_min(vec_set1(LIMIT_U), vec_abs(m->dt) * m->per_width);
}

static vec limit_age(vec age)
{
    return vec_clamp(age, vec_set1(-LIMIT_AGE), vec_set1(LIMIT_AGE));
}

/* --- Forward ------------------------------------------------------------- */

/* The coefficients of a motion, and their unit. */
typedef struct {
    vec b[9], support[3];
} path;

static void path_of(path *way, const saga_splat_params *p, lanes at)
{
    lanes_get_rows(way->b, p->motion, 9, at);
    if (p->support)
        lanes_get_rows(way->support, p->support, 3, at);
    else
        for (int a = 0; a < 3; a++)
            way->support[a] = vec_set1(1);
}

/* Returns b1 age + b2 age^2 + b3 age^3 along an axis. */
static vec moved(const path *way, int axis, vec age)
{
    const vec *const b = way->b + axis;

    return ((b[6] * age + b[3]) * age + b[0]) * age;
}

static void animate_mean(real *mean, const saga_splat_params *p, lanes at,
                         vec age)
{
    vec x[3];
    path way;

    lanes_get_rows(x, p->mean, 3, at);
    if (p->motion) {
        path_of(&way, p, at);
        for (int a = 0; a < 3; a++)
            x[a] += way.support[a] * moved(&way, a, age);
    }
    lanes_set_rows(mean, 3, at, x);
}

void saga_splat_place(real *mean, const saga_splat_params *p, saga_range of,
                      real t)
{
    for (size_t i = of.begin; i < of.end; i += VEC_LANES) {
        const lanes at = lanes_from(of, i);
        const timing m = timing_of(p, at, t);

        animate_mean(mean, p, at, limit_age(m.dt * m.pace));
    }
}

SAGA_ISA_CHOOSE(saga_splat_place);

static void animate(saga_splat_posed *out, const saga_splat_params *p, lanes at,
                    real t)
{
    const timing m = timing_of(p, at, t);
    const vec age = limit_age(m.dt * m.pace);
    /* An opacity o means alpha = 8 / (1 + 2^(3 - o)); q0 is its -log2. */
    vec q0 = softplus2(PEAK - lanes_get(p->opacity, at)) - PEAK;
    vec quat[4], slope[4];

    animate_mean(out->mean, p, at, age);
    lanes_get_rows(quat, p->quat, 4, at);
    if (p->slope) {
        lanes_get_rows(slope, p->slope, 4, at);
        for (int a = 0; a < 4; a++)
            quat[a] += slope[a] * age;
    }
    lanes_set_rows(out->quat, 4, at, quat);
    if (p->log2_width) {
        const vec u = width_ratio(&m);

        /* Alpha falls by exp(-u^2) with the time from the centre. */
        q0 += LOG2_E * u * u;
    }
    lanes_set(out->q0, at, q0);
}

void saga_splat_animate_forward(saga_splat_posed *out,
                                const saga_splat_params *p, saga_range of,
                                real t)
{
    for (size_t i = of.begin; i < of.end; i += VEC_LANES)
        animate(out, p, lanes_from(of, i), t);
}

SAGA_ISA_CHOOSE(saga_splat_animate_forward);

/* --- Backward ------------------------------------------------------------ */

/* The primitives of a backward pass. */
typedef struct {
    const saga_splat_params *p;
    const saga_splat_posed *d_out;
    lanes at;
    veci seen; /* a primitive that is not drawn has no gradient */
    int order; /* of the motions that get gradients */
} group;

/* Returns dL/dage through the motion. */
static vec motion_backward(saga_splat_params *d, const group *g, vec age)
{
    const vec age2 = age * age, age3 = age * age * age;
    vec d_mean[3], d_motion[9], d_support[3], d_age = vec_zero();
    path way;

    lanes_get_rows(d_mean, g->d_out->mean, 3, g->at);
    lanes_add_rows(d->mean, 3, g->at, g->seen, d_mean);
    if (!g->p->motion)
        return d_age;
    path_of(&way, g->p, g->at);
    for (int a = 0; a < 3; a++) {
        /* The mean moves by s w(age), w = b1 age + b2 age^2 + b3 age^3, so that
         * dL/db_k = s dL/dmean age^k and dL/dage = s dL/dmean w'(age). */
        const vec *const b = way.b + a;
        const vec s = way.support[a] * d_mean[a];

        d_motion[a] = s * age;
        d_motion[3 + a] = s * age2;
        d_motion[6 + a] = s * age3;
        d_support[a] = d_mean[a] * moved(&way, a, age);
        d_age += s * ((3 * b[6] * age + 2 * b[3]) * age + b[0]);
    }
    for (int k = 3 * g->order; k < 9; k++)
        d_motion[k] = vec_zero();
    if (d->motion)
        lanes_add_rows(d->motion, 9, g->at, g->seen, d_motion);
    if (d->support)
        lanes_add_rows(d->support, 3, g->at, g->seen, d_support);
    return d_age;
}

/* Returns dL/dage through the rotation. */
static vec quat_backward(saga_splat_params *d, const group *g, vec age)
{
    vec d_quat[4], slope[4], d_slope[4], d_age = vec_zero();

    lanes_get_rows(d_quat, g->d_out->quat, 4, g->at);
    lanes_add_rows(d->quat, 4, g->at, g->seen, d_quat);
    if (!g->p->slope)
        return d_age;
    lanes_get_rows(slope, g->p->slope, 4, g->at);
    for (int a = 0; a < 4; a++) {
        d_slope[a] = d_quat[a] * age;
        d_age += d_quat[a] * slope[a];
    }
    if (d->slope)
        lanes_add_rows(d->slope, 4, g->at, g->seen, d_slope);
    return d_age;
}

/* Adds the gradients of opacity and width. d log2(1 + 2^(3 - o)) / do = -1 / (1
 * + 2^(o - 3)). With u = |dt| / width below its limit, q = log2(e) u^2 gives
 * dq/d log2_width = -2 u^2 and dq/ddt = 2 log2(e) u^2 / dt. Returns dL/ddt. */
static vec opacity_backward(saga_splat_params *d, const group *g,
                            const timing *m)
{
    const vec d_q0 = lanes_get(g->d_out->q0, g->at);
    const vec o = lanes_get(g->p->opacity, g->at);
    vec u;
    veci inside;

    lanes_add(d->opacity, g->at, g->seen, -d_q0 / (1 + vec_exp2(o - PEAK)));
    if (!g->p->log2_width)
        return vec_zero();
    u = width_ratio(m);
    inside = (veci)(u < LIMIT_U);
    if (d->log2_width)
        lanes_add(d->log2_width, g->at, g->seen & inside, -2 * u * u * d_q0);
    return vec_and(inside & (veci)(m->dt != 0),
                   d_q0 * 2 * LOG2_E * u * u / m->dt);
}

static void animate_backward(saga_splat_params *d, const group *g,
                             const saga_canvas *c)
{
    const timing m = timing_of(g->p, g->at, c->t);
    const vec age = m.dt * m.pace, limited = limit_age(age);
    const vec d_age = motion_backward(d, g, limited) +
                      quat_backward(d, g, limited);
    vec d_dt = opacity_backward(d, g, &m);

    /* age = pace dt, and below a width of 1/2 pace = 2^-log2_width. At its
     * limit the age is constant, and no gradient passes. */
    if (!c->rules.detach_time) {
        const veci inside = (veci)(vec_abs(age) < LIMIT_AGE);

        d_dt += vec_and(inside, m.pace * d_age);
        if (d->log2_width)
            lanes_add(d->log2_width, g->at, g->seen & inside & m.is_short,
                      -LN_2 * age * d_age);
    }
    /* dt = t - t_centre */
    if (d->t_centre)
        lanes_add(d->t_centre, g->at, g->seen, -d_dt);
}

void saga_splat_animate_backward(saga_splat_params *d, const saga_canvas *c,
                                 const saga_splat_params *p, saga_range of)
{
    for (size_t i = of.begin; i < of.end; i += VEC_LANES) {
        const lanes at = lanes_from(of, i);
        const group g = { p, &c->splat.d_posed, at,
                          (veci)(lanes_get(c->splat.extent, at) > 0),
                          c->rules.order };

        if (vec_any(g.seen))
            animate_backward(d, &g, c);
    }
}

SAGA_ISA_CHOOSE(saga_splat_animate_backward);
