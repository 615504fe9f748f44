/* SPDX-License-Identifier: MIT
 *
 * Primitives at a time are compared with double. The bounds follow from the
 * roundings that docs/arithmetic.md prescribes:
 *
 *     age          0.51 LSB of Q16
 *     position     1/2 + 10.5 support / 2^20 box units: three roundings of
 *                  Q20, of which the first two are multiplied by |age| <= 4
 *                  each; and the motion within the error of the age
 *     quaternion   one rounding of its slope and one of the common shift
 *     q0           1.31 LSB of Q20 from softplus2, 128 more if the opacity is
 *                  rounded to Q12 first; the fade: u to 0.51 LSB of Q16 and
 *                  log2(e) to 0.4 LSB of Q20
 */
#include "animate.h"
#include "gen_hard.h"
#include "testing.h"

enum { ROUNDS = 300000 };

static const double log2_e = 1.4426950408889634;
static const double limit_x = 536870912; /* 2^29 */

static int32_t any_t(gen_rng *r)
{
    return gen_one_in(r, 8)   ? 0
           : gen_one_in(r, 8) ? 65535
                              : gen_int(r, 0, 65535);
}

/* --- Position ------------------------------------------------------------ */

/* Returns the age in temporal widths since the centre, at most 4. */
static double true_age(const saga_primitive *p, const saga_prim_format *f,
                       int32_t t)
{
    const double width = f->has_width
                             ? fmin(32768, exp2(p->log2_width_q10 / 1024.0))
                             : 32768;

    return fmin(fmax((t - p->t_centre) / width, -4), 4);
}

static double cubic(const saga_primitive *p, const saga_prim_format *f,
                    int axis, double age)
{
    double m = 0;

    for (int k = 0; k < f->motion_order; k++)
        m += ldexp(p->motion[3 * k + axis], -f->q_motion[k]) * pow(age, k + 1);
    return fmin(fmax(m, -524288), 524288);
}

/* Returns the largest change of the cubic if the age is wrong by 0.51 LSB. */
static double age_error(const saga_primitive *p, const saga_prim_format *f,
                        int axis, double age)
{
    double d = 0;

    for (int k = 0; k < f->motion_order; k++)
        d += fabs(ldexp(p->motion[3 * k + axis], -f->q_motion[k])) * (k + 1) *
             pow(fabs(age) + 1e-4, k);
    return d * 0.51 / 65536;
}

static void check_position(const saga_animated *a, const saga_primitive *p,
                           const saga_prim_format *f, int32_t t)
{
    const double age = true_age(p, f, t);

    for (int i = 0; i < 3; i++) {
        const double m = cubic(p, f, i, age);
        const double x = fmin(fmax(p->x[i] + p->support[i] * m, -limit_x),
                              limit_x);
        const double bound = 0.5001 + p->support[i] * (10.5 / 1048576.0 +
                                                       age_error(p, f, i, age));

        assert_true(fabs(a->x[i] - x) <= bound);
        assert_true(a->x[i] >= -(1 << 29) && a->x[i] <= 1 << 29);
        if (f->motion_order == 0 || t == p->t_centre)
            assert_int_equal(a->x[i], p->x[i]);
    }
}

TEST(position_should_follow_the_cubic)
{
    gen_rng r = gen_seeded(11);
    saga_prim_format f;
    saga_primitive p;
    saga_animated a;
    int saturated = 0;

    for (int i = 0; i < ROUNDS; i++) {
        const int32_t t = any_t(&r);

        gen_hard_format(&f, &r);
        gen_hard_primitive(&p, &r, 12);
        saga_animate(&a, &p, &f, t);
        check_position(&a, &p, &f, t);
        saturated += abs(a.x[0]) == 1 << 29;
    }
    print_message("%d of %d saturated\n", saturated, ROUNDS);
    assert_true(saturated > ROUNDS / 100 && saturated < ROUNDS / 2);
}

/* --- Quaternion ---------------------------------------------------------- */

static double largest(const double *v)
{
    return fmax(fmax(fabs(v[0]), fabs(v[1])), fmax(fabs(v[2]), fabs(v[3])));
}

/* Compares a quaternion with v, its components in Q20, which are exact in
 * double. Rounded to integers, the components must be shifted right by a common
 * n, the least that brings them below 2^30. */
static void check_quat(const saga_animated *a, const double *v)
{
    double rounded[4];
    int32_t max = 0;
    int n = 0;

    for (int i = 0; i < 4; i++)
        rounded[i] = floor(v[i] + 0.5);
    while (ldexp(1, 30 + n) <= largest(rounded))
        n++;
    for (int i = 0; i < 4; i++) {
        assert_true(fabs(ldexp(a->quat[i], n) - rounded[i]) <=
                    (n ? ldexp(0.5, n) : 0));
        max = abs(a->quat[i]) > max ? abs(a->quat[i]) : max;
    }
    assert_true(max <= 1 << 30);
    assert_true(n == 0 || max >= 1 << 29);
}

TEST(quaternion_should_be_linear_in_age)
{
    gen_rng r = gen_seeded(12);
    saga_prim_format f;
    saga_primitive p;
    saga_animated a;
    double v[4];

    for (int i = 0; i < ROUNDS; i++) {
        const int32_t t = any_t(&r);

        gen_hard_format(&f, &r);
        gen_hard_primitive(&p, &r, 12);
        p.log2_width_q10 &= ~1023; /* the age is exact */
        saga_animate(&a, &p, &f, t);
        for (int k = 0; k < 4; k++)
            v[k] = ldexp(p.quat[k], 20 - f.q_quat) +
                   (f.has_slope ? ldexp(p.slope[k], 20 - f.q_slope) *
                                      true_age(&p, &f, t)
                                : 0);
        check_quat(&a, v);
    }
}

/* --- Opacity ------------------------------------------------------------- */

/* log2(1 + 2^x), |x| <= 256. */
static double softplus2(double x)
{
    return x > 60 ? x : log1p(exp2(x)) * log2_e;
}

static double true_ratio(const saga_primitive *p, int32_t t)
{
    return fmin(16, abs(t - p->t_centre) * exp2(-p->log2_width_q10 / 1024.0));
}

static void check_opacity(const saga_animated *a, const saga_primitive *p,
                          const saga_prim_format *f, int32_t t)
{
    const double o = ldexp(p->opacity, -f->q_opacity);
    double q0 = softplus2(fmin(fmax(3 - o, -256), 256));
    double bound = 1.32 + (f->q_opacity > 12 ? 128 : 0);

    if (f->has_width) {
        const double u = true_ratio(p, t);

        q0 += log2_e * u * u;
        bound += 0.51 + 2 * log2_e * u * 16 * 0.51 + 0.4 * u * u;
    }
    assert_true(fabs(a->q0_q20 - 1048576 * q0) <= bound);
    assert_true(a->q0_q20 >= 0);
}

TEST(opacity_should_fade_with_the_distance_in_time)
{
    gen_rng r = gen_seeded(14);
    saga_prim_format f;
    saga_primitive p;
    saga_animated a;
    int visible = 0;

    for (int i = 0; i < ROUNDS; i++) {
        const int32_t t = any_t(&r);

        gen_hard_format(&f, &r);
        gen_hard_primitive(&p, &r, 12);
        if (gen_one_in(&r, 2)) /* a width of about a segment */
            p.log2_width_q10 = (int16_t)gen_int(&r, 10 << 10, 18 << 10);
        saga_animate(&a, &p, &f, t);
        check_opacity(&a, &p, &f, t);
        visible += f.has_width && a.q0_q20 < 11 << 20;
    }
    print_message("%d of %d with a width are visible\n", visible, ROUNDS / 2);
    assert_true(visible > ROUNDS / 20);
}

/* The fade is compared for every width, at temporal distances around the one
 * where the fade saturates. */
TEST(every_width_should_fade)
{
    static const int32_t distance[] = { 0, 1, 2, 255, 256, 8191, 65535, 98303 };
    const saga_prim_format f = { .q_opacity = 12, .has_width = 1 };
    saga_primitive p = { 0 };
    saga_animated a;

    for (int32_t w = -32768; w <= 32767; w++)
        for (int i = 0; i < 8; i++) {
            const int32_t t = distance[i] < 65535 ? distance[i] : 65535;

            p.log2_width_q10 = (int16_t)w;
            p.t_centre = t - distance[i];
            saga_animate(&a, &p, &f, t);
            check_opacity(&a, &p, &f, t);
            if (i == 0)
                assert_int_equal(a.q0_q20, 3323907); /* log2(1 + 2^3) */
        }
}

/* --- Fields -------------------------------------------------------------- */

static void fill(void *p, size_t n, gen_rng *r)
{
    uint8_t *const bytes = p;

    for (size_t i = 0; i < n; i++)
        bytes[i] = (uint8_t)gen_u32(r);
}

TEST(fields_of_tools_that_are_off_should_not_be_read)
{
    gen_rng r = gen_seeded(15);
    saga_prim_format f;
    saga_primitive p;
    saga_animated a, b;

    for (int i = 0; i < ROUNDS / 3; i++) {
        const int32_t t = any_t(&r);

        gen_hard_format(&f, &r);
        gen_hard_primitive(&p, &r, 12);
        memset(&a, 0x00, sizeof a);
        saga_animate(&a, &p, &f, t);
        fill(p.motion + 3 * f.motion_order,
             (size_t)(3 - f.motion_order) * 3 * sizeof *p.motion, &r);
        for (int k = f.motion_order; k < 3; k++)
            f.q_motion[k] = (uint8_t)gen_u32(&r);
        if (!f.has_slope) {
            fill(p.slope, sizeof p.slope, &r);
            f.q_slope = (uint8_t)gen_u32(&r);
        }
        if (!f.has_width)
            fill(&p.log2_width_q10, sizeof p.log2_width_q10, &r);
        memset(&b, 0xff, sizeof b);
        saga_animate(&b, &p, &f, t);
        assert_memory_equal(&a, &b, sizeof a);
        for (int k = 0; k < 3; k++)
            assert_int_equal(a.log2_scale_q10[k], p.log2_scale_q10[k]);
    }
}
