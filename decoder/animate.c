/* SPDX-License-Identifier: MIT
 *
 * Primitives at a given time: see animate.h, and docs/arithmetic.md for the
 * normative formulas.
 * dt is in 1/65536 segment, so a product with dt is shifted right by 16.
 */
#include "animate.h"

#include "fx.h"
#include "fx_math.h"
#include "model.h"

/* Converts an output of a network to Q20: |result| <= 2^15 * 2^20. */
static int64_t to_q20(int16_t v, int q)
{
    return v * ((int64_t)1 << (20 - q));
}

/* Returns |dt| / width in Q16, saturating at 16. With 1/width = m * 2^(k-30), m
 * in [2^30, 2^31) and k in -32..32, it is |dt| m (below 2^48) shifted right by
 * 14 - k. If that shift is below 11, the result saturates for any |dt| >= 1. */
static int32_t width_ratio_q16(int32_t dt, int32_t log2_width_q10)
{
    const int32_t e = -log2_width_q10;
    const int n = 14 - (e >> 10);
    const uint32_t m = saga_exp2_frac_q16_q30((uint32_t)(e & 1023) << 6);
    const int64_t product = (int64_t)(dt < 0 ? -dt : dt) * m;

    if (n < 11)
        return product != 0 ? LIMIT_U : 0;
    return fx_clamp64(fx_rshift64(product, n), 0, LIMIT_U);
}

/* A primitive's place in its own time, Q16. */
typedef struct {
    int32_t u;   /* |dt| in temporal widths, at most 16 */
    int32_t age; /* dt in them, |age| <= 4 */
} moment;

/* For the age, a width longer than half a segment counts as half a segment,
 * which has the ratio 2 |dt|. */
static moment moment_of(const saga_primitive *p, const saga_prim_format *f,
                        int32_t t)
{
    const int32_t dt = t - p->t_centre;
    int32_t age = dt < 0 ? -2 * dt : 2 * dt;
    moment m = { 0, 0 };

    if (f->has_width) {
        m.u = width_ratio_q16(dt, p->log2_width_q10);
        if (p->log2_width_q10 < HALF_SEGMENT)
            age = m.u;
    }
    age = age < LIMIT_AGE ? age : LIMIT_AGE;
    m.age = dt < 0 ? -age : age;
    return m;
}

/* Computes x + support ((b3 age + b2) age + b1) age. Since |b| <= 2^35 in Q20
 * and |age| <= 4, the sums are at most 1, 5 and 21 times 2^35, the products are
 * below 2^58, and the motion is below 2^42 before it saturates. With support <=
 * 2^23 the last product is at most 2^62. */
static void animate_mean(int32_t x[3], const saga_primitive *p,
                         const saga_prim_format *f, int32_t age)
{
    int64_t sum[3] = { 0 };
    int order, i;

    for (order = f->motion_order; order >= 1; order--) {
        /* Horner's scheme, from the highest order down. */
        const int16_t *const b = p->motion + 3 * (order - 1);
        const int q = f->q_motion[order - 1];

        for (i = 0; i < 3; i++)
            sum[i] = fx_rshift64((sum[i] + to_q20(b[i], q)) * age, 16);
    }
    for (i = 0; i < 3; i++) {
        const int64_t motion = sum[i] < -LIMIT_MOTION  ? -LIMIT_MOTION
                               : sum[i] > LIMIT_MOTION ? LIMIT_MOTION
                                                       : sum[i];

        x[i] = fx_clamp64(p->x[i] + fx_rshift64(motion * p->support[i], 20),
                          -LIMIT_X, LIMIT_X);
    }
}

/* Returns the common shift, 0..8, that brings four values below 2^38 under
 * 2^30. It depends on the values only, so that a slope of 0 gives the same
 * rotation as no slope. The shift itself does not matter, since projection
 * ignores the quaternion's length. */
static int quat_shift(const int64_t *v)
{
    uint64_t bits = 1;
    int n, i;

    for (i = 0; i < 4; i++)
        bits |= (uint64_t)(v[i] < 0 ? -v[i] : v[i]);
    /* The values have 64 - clz bits, of which 30 may remain. */
    n = 34 - fx_clz64(bits);
    return n > 0 ? n : 0;
}

/* quat + slope age in Q20: below 2^35 + 4 * 2^35 < 2^38. */
static void animate_quat(saga_animated *out, const saga_primitive *p,
                         const saga_prim_format *f, int32_t age)
{
    int64_t v[4];
    int i, n;

    for (i = 0; i < 4; i++) {
        v[i] = to_q20(p->quat[i], f->q_quat);
        if (f->has_slope)
            v[i] += fx_rshift64(to_q20(p->slope[i], f->q_slope) * age, 16);
    }
    n = quat_shift(v);
    for (i = 0; i < 4; i++)
        out->quat[i] = (int32_t)fx_rshift64(v[i], n);
}

/* Returns log2(e) u^2 in Q20. u^2 <= 2^40 in Q32, the product is below 2^61,
 * and the result is at most 370 * 2^20 < 2^29. */
static int32_t fade_q20(int64_t u)
{
    return (int32_t)fx_rshift64(u * u * LOG2_E_Q20, 32);
}

/* With the network's o in log2 units opacity = 2^3 / (1 + 2^(3 - o)), so that
 * q0 = 3 - log2(opacity) = log2(1 + 2^(3 - o)); a fading primitive's exp(-u^2)
 * adds log2(e) u^2. */
static int32_t q0_q20(const saga_primitive *p, const saga_prim_format *f,
                      int32_t u)
{
    const int32_t o_q12 = fx_requant32(-(int32_t)p->opacity, f->q_opacity, 12) +
                          (SAGA_PEAK_LOG2 << 12);

    return saga_softplus2_q12_q20(o_q12) + fade_q20(u);
}

int saga_animate_visible(saga_animated *out, const saga_primitive *p,
                         const saga_prim_format *f, int32_t t)
{
    const moment m = moment_of(p, f, t);
    int i;

    out->q0_q20 = q0_q20(p, f, m.u);
    if (out->q0_q20 >= SAGA_CUT_Q20)
        return 0;
    animate_mean(out->x, p, f, m.age);
    animate_quat(out, p, f, m.age);
    for (i = 0; i < 3; i++)
        out->log2_scale_q10[i] = p->log2_scale_q10[i];
    return 1;
}

void saga_animate(saga_animated *out, const saga_primitive *p,
                  const saga_prim_format *f, int32_t t)
{
    const moment m = moment_of(p, f, t);
    int i;

    animate_mean(out->x, p, f, m.age);
    animate_quat(out, p, f, m.age);
    for (i = 0; i < 3; i++)
        out->log2_scale_q10[i] = p->log2_scale_q10[i];
    out->q0_q20 = q0_q20(p, f, m.u);
}

void saga_animate_mean(int32_t x[3], const saga_primitive *p,
                       const saga_prim_format *f, int32_t t)
{
    animate_mean(x, p, f, moment_of(p, f, t).age);
}
