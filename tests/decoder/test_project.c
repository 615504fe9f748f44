/* SPDX-License-Identifier: MIT
 *
 * Projection is compared with double: the factor of the conic, q inside the
 * cut, and the mean. The rules that drop a splat must hold exactly. The limits
 * of a camera are checked, and boxes are compared with every pixel of small
 * pictures.
 *
 * Bounds: the arithmetic after T adds at most 2 LSB of Q28 to a factor. T
 * itself is wrong by up to
 *
 *     delta = sigma (2^-17 / f + 2^-25) px,
 *
 * where sigma is the largest axis seen from the side, in px, and f the shorter
 * focal length: the slope of the Jacobian is rounded to 2^-16 px, x, y and z to
 * 27 bits, and T to 30 bits of its largest entry. The effect on a factor
 * follows by differentiation (factor_bound). It is nothing for a point, about
 * 100 LSB for usual splats, and the whole error for needles of 1:10^4. Even
 * then q, on which the picture depends, is within 7e-4.
 */
#include "gen_hard.h"
#include "project.h"
#include "ref_render.h"
#include "testing.h"

#define CUT (11 << 20)
enum { ROUNDS = 200000, SAMPLES = 8 };

static const double q28 = 268435456;
static const int sides[] = { 40, 640, 4096, 16384 };

/* --- The factor, q and the mean ------------------------------------------ */

typedef struct {
    saga_camera cam;
    saga_animated a;
    saga_splat s;
    ref_splat ref;
    int is_visible, is_kept; /* whether the decoder and the reference draw
                              * it */
} trial;

static int64_t dot(const int32_t *row, const int32_t *x, const int32_t *c)
{
    int64_t sum = 0;

    for (int i = 0; i < 3; i++)
        sum += (int64_t)row[i] * ((int64_t)x[i] - c[i]);
    return sum;
}

/* Returns z with halves rounded up, or any value behind the camera. */
static int64_t depth(const trial *t)
{
    const int64_t z = dot(t->cam.rotation_q30 + 6, t->a.x, t->cam.centre);

    return z < 0 ? 0 : (z + (1 << 29)) >> 30;
}

/* The tools with which all further trials are projected. */
static uint32_t tools;

static void project_both(trial *t)
{
    ref_animated a;

    memset(&t->s, 0x5a, sizeof t->s);
    t->is_visible = saga_project(&t->s, &t->a, &t->cam, tools);
    ref_animated_of(&a, &t->a);
    t->is_kept = ref_project(&t->ref, &a, &t->cam);
}

static void hard_trial(trial *t, gen_rng *r, int width, int height)
{
    gen_hard_camera(&t->cam, r, width, height);
    gen_hard_animated(&t->a, r, &t->cam);
    project_both(t);
}

/* Makes a trial in a picture of any size up to side. */
static void small_trial(trial *t, gen_rng *r, int side)
{
    const int width = gen_int(r, 1, side), height = gen_int(r, 1, side);

    hard_trial(t, r, width, height);
}

static double focal(const trial *t, int axis)
{
    return t->cam.focal_q16[axis] / 65536.0;
}

/* Returns the error of T in px; see above. */
static double shape_error(const trial *t)
{
    const int32_t *const l = t->a.log2_scale_q10;
    const int32_t top = l[0] > l[1] ? (l[0] > l[2] ? l[0] : l[2])
                                    : (l[1] > l[2] ? l[1] : l[2]);
    const double z = t->ref.depth < 1 ? 1 : t->ref.depth;
    const double f = fmax(focal(t, 0), focal(t, 1));
    const double least = fmin(focal(t, 0), focal(t, 1));
    const double sigma = exp2(top / 1024.0) / z * f;

    return sigma * (ldexp(1, -17) / least + ldexp(1, -25));
}

/* Sets the bounds of the factors' errors, to first order in delta. With
 * V = det / C, the variance of x given y, and l = B / C:
 *     dg <= g delta (1 + |l|) / sqrt(V),    dh <= h delta / sqrt(C),
 *     dn <= |l| dg + g delta (sqrt(C) (1 + |l|) + sqrt(V)) / C. */
static void factor_bound(double bound[3], const trial *t)
{
    const double delta = shape_error(t);
    const double c = t->ref.cov[2], v = t->ref.det / c;
    const double l = fabs(t->ref.cov[1]) / c;
    const double dg = t->ref.chol[0] * delta * (1 + l) / sqrt(v);

    bound[0] = 2 + q28 * dg;
    bound[1] = 2 + q28 * (l * dg + t->ref.chol[0] * delta *
                                       (sqrt(c) * (1 + l) + sqrt(v)) / c);
    bound[2] = 2 + q28 * t->ref.chol[2] * delta / sqrt(c);
}

typedef struct {
    double factor, ordinary, mean, q; /* worst: relative to the bound, in LSB
                                       * where the bound is < 2.5, LSB, q */
    long n, n_ordinary, n_q;
} errors;

static void note(double *worst, double x)
{
    *worst = fmax(*worst, x);
}

static void check_factor(errors *e, const trial *t)
{
    double bound[3];

    factor_bound(bound, t);
    for (int i = 0; i < 3; i++) {
        const double err = fabs(t->s.chol_q28[i] - q28 * t->ref.chol[i]);

        note(&e->factor, err / bound[i]);
        if (bound[i] < 2.5)
            note(&e->ordinary, err);
        e->n_ordinary += bound[i] < 2.5;
        e->n++;
    }
}

/* Checks the mean. Its error is half a unit, and the error of x/z because x and
 * z have 27 bits. */
static void check_mean(errors *e, const trial *t)
{
    for (int i = 0; i < 2; i++) {
        const double p = t->cam.principal_q16[i] / 65536.0;
        const double x = 1.125 * fabs(t->ref.mean[i] - p) + 1.25 * focal(t, i);
        const double err = fabs(t->s.mean_q8[i] - 256 * t->ref.mean[i]);

        note(&e->mean, err);
        assert_true(err <= 0.5 + x * ldexp(256, -27));
    }
}

/* Picks a pixel inside the ellipse of the cut, uniformly. Returns 0 if it is
 * not in the picture. */
static int pick_pixel(int pixel[2], const trial *t, gen_rng *r)
{
    const double l = sqrt((11 - t->ref.q0) * gen_uniform(r, 0, 1));
    const double turn = gen_uniform(r, 0, 6.283185307179586);
    const double dy = l * sin(turn) / t->ref.chol[2];
    const double dx = (l * cos(turn) + t->ref.chol[1] * dy) / t->ref.chol[0];
    const double x = floor(t->s.mean_q8[0] / 256.0 + dx);
    const double y = floor(t->s.mean_q8[1] / 256.0 + dy);

    if (!(x >= 0 && x < t->cam.width && y >= 0 && y < t->cam.height))
        return 0;
    pixel[0] = (int)x;
    pixel[1] = (int)y;
    return 1;
}

static double true_q(const trial *t, int x, int y)
{
    return ref_q(&t->ref, x + 0.5 - t->s.mean_q8[0] / 256.0,
                 y + 0.5 - t->s.mean_q8[1] / 256.0);
}

static void check_q(errors *e, const trial *t, gen_rng *r)
{
    int pixel[2];

    for (int i = 0; i < SAMPLES; i++) {
        double q;

        if (!pick_pixel(pixel, t, r))
            continue;
        q = true_q(t, pixel[0], pixel[1]);
        if (q > 8)
            continue;
        note(&e->q,
             fabs(ref_q_q20(&t->s, pixel[0], pixel[1], 0) / 1048576.0 - q));
        e->n_q++;
    }
}

static void print_errors(const errors *e)
{
    print_message("%ld factors within %.2f of their bound, %ld ordinary ones "
                  "within %.2f LSB; mean within %.3f LSB; q within %.1e at "
                  "%ld pixels\n",
                  e->n, e->factor, e->n_ordinary, e->ordinary, e->mean, e->q,
                  e->n_q);
}

TEST(factor_and_q_should_be_those_of_double)
{
    gen_rng r = gen_seeded(21);
    errors e = { 0, 0, 0, 0, 0, 0, 0 };
    trial t;

    for (int i = 0; i < ROUNDS; i++) {
        hard_trial(&t, &r, sides[i & 3], sides[i >> 2 & 3]);
        if (!t.is_visible)
            continue;
        assert_true(t.is_kept);
        assert_true(t.s.depth == (uint32_t)floor(t.ref.depth + 0.5));
        assert_int_equal(t.s.q0_q20, t.a.q0_q20);
        check_factor(&e, &t);
        check_mean(&e, &t);
        if (fmin(focal(&t, 0), focal(&t, 1)) >= 64)
            check_q(&e, &t, &r);
    }
    print_errors(&e);
    assert_true(e.n_ordinary > ROUNDS / 10 && e.n_q > ROUNDS / 10);
    assert_true(e.factor <= 1);
    assert_true(e.ordinary <= 2);
    assert_true(e.q <= 7e-4);
}

/* Splats as they occur in pictures have axes of 0.1 to 40 px, and the focal
 * length is the picture's width. Their factors must be within 2 LSB plus the
 * effect that rounding the slope has on axes along the line of sight. */
TEST(ordinary_splats_should_be_exact_to_the_last_bits)
{
    gen_rng r = gen_seeded(22);
    errors e = { 0, 0, 0, 0, 0, 0, 0 };
    double raw = 0;
    trial t;

    for (int i = 0; i < ROUNDS; i++) {
        hard_trial(&t, &r, 640, 360);
        gen_any_camera(&t.cam, &r, 640, 360, 1 << 20);
        for (int k = 0; k < 3; k++) {
            const double z = (double)depth(&t) + 1;
            const double sigma = gen_uniform(&r, log2(0.1), log2(40));

            t.a.log2_scale_q10[k] = (int32_t)(1024 * (sigma + log2(z / 640)));
        }
        project_both(&t);
        if (!t.is_visible)
            continue;
        check_factor(&e, &t);
        check_mean(&e, &t);
        check_q(&e, &t, &r);
        for (int k = 0; k < 3; k++)
            note(&raw, fabs(t.s.chol_q28[k] - q28 * t.ref.chol[k]));
    }
    print_errors(&e);
    print_message("factors within %.1f LSB\n", raw);
    assert_true(e.n > ROUNDS / 10);
    assert_true(e.factor <= 1 && e.ordinary <= 2 && e.q <= 7e-4);
}

/* --- Dropping ------------------------------------------------------------ */

/* Returns whether the rules that come before the mean let the splat pass, as
 * docs/arithmetic.md words them. */
static int is_in_front(const trial *t)
{
    const int32_t *const w = t->cam.rotation_q30;
    const int64_t x = dot(w, t->a.x, t->cam.centre);
    const int64_t y = dot(w + 3, t->a.x, t->cam.centre);
    const int64_t z = dot(w + 6, t->a.x, t->cam.centre);

    return t->a.q0_q20 < CUT && depth(t) >= t->cam.near_plane &&
           llabs(x) / 8 < z && llabs(y) / 8 < z;
}

/* Returns 1 if the mean is too far from the picture's centre, 0 if not, -1 if
 * double cannot decide. */
static int is_far(const trial *t)
{
    const int32_t *const w = t->cam.rotation_q30;
    const double z = (double)dot(w + 6, t->a.x, t->cam.centre);
    const double side[2] = { t->cam.width, t->cam.height };
    double d = -32768;

    for (int i = 0; i < 2; i++) {
        const double x = (double)dot(w + 3 * i, t->a.x, t->cam.centre);
        const double mean = t->cam.principal_q16[i] / 65536.0 +
                            focal(t, i) * x / z;

        d = fmax(d, fabs(mean - side[i] / 2) - 32768);
    }
    return fabs(d) < 1.0 / 128 ? -1 : d > 0;
}

static int min_true_q_is_below(const trial *t, double limit)
{
    trial u = *t;

    u.s.mean_q8[0] = (int32_t)floor(256 * t->ref.mean[0] + 0.5);
    u.s.mean_q8[1] = (int32_t)floor(256 * t->ref.mean[1] + 0.5);
    for (int y = 0; y < t->cam.height; y++)
        for (int x = 0; x < t->cam.width; x++)
            if (true_q(&u, x, y) < limit)
                return 1;
    return 0;
}

/* A splat may be dropped only if a rule of docs/arithmetic.md says so, or if it
 * touches no pixel. */
TEST(splats_should_be_dropped_by_the_rules_alone)
{
    gen_rng r = gen_seeded(23);
    int n_rule = 0, n_far = 0, n_box = 0;
    trial t;

    for (int i = 0; i < ROUNDS / 4; i++) {
        small_trial(&t, &r, 24);
        if (i % 4 == 0) {
            t.cam.focal_q16[i / 4 & 1] = gen_int(&r, 1 << 28, INT32_MAX);
            project_both(&t);
        }
        if (!is_in_front(&t)) {
            assert_false(t.is_visible);
            n_rule++;
        } else if (is_far(&t) == 1) {
            assert_false(t.is_visible);
            n_far++;
        } else if (is_far(&t) == 0 && !t.is_visible) {
            assert_true(t.is_kept);
            assert_false(min_true_q_is_below(&t, 7.99));
            n_box++;
        }
    }
    print_message("%d by near, angle or opacity, %d too far, %d by the box\n",
                  n_rule, n_far, n_box);
    assert_true(n_rule > 100 && n_far > 100 && n_box > 100);
}

/* Makes a wide splat on the axis of a front camera at depth 2^12, which is
 * drawn unless a test changes it. */
static void front_trial(trial *t)
{
    memset(t, 0, sizeof *t);
    gen_front_camera(&t->cam, 64, 64);
    t->a.x[2] = 1 << 12;
    t->a.quat[0] = 1;
    for (int i = 0; i < 3; i++)
        t->a.log2_scale_q10[i] = 28 << 10;
}

static void expect(trial *t, int is_visible)
{
    assert_int_equal(saga_project(&t->s, &t->a, &t->cam, tools), is_visible);
}

TEST(near_plane_should_be_exact)
{
    trial t;

    front_trial(&t);
    t.cam.near_plane = 1 << 12;
    expect(&t, 1);
    assert_int_equal(t.s.depth, 1 << 12);
    t.cam.near_plane++;
    expect(&t, 0);
    t.cam.rotation_q30[8] = 1 << 29; /* depth = z / 2, ties rounded up */
    t.a.x[2] = 4095;
    t.cam.near_plane = 2048;
    expect(&t, 1);
    assert_int_equal(t.s.depth, 2048);
    t.cam.near_plane = 2049;
    expect(&t, 0);
    t.cam.near_plane = 1;
    t.a.x[2] = 1;
    expect(&t, 1);
    assert_int_equal(t.s.depth, 1);
    t.a.x[2] = 0;
    expect(&t, 0);
    t.a.x[2] = -4096;
    expect(&t, 0);
}

TEST(angles_should_be_cut_at_eight)
{
    static const struct {
        int32_t x, visible;
    } cases[] = { { 8 << 12, 0 },       { (8 << 12) - 1, 1 }, { -(8 << 12), 0 },
                  { 1 - (8 << 12), 1 }, { (8 << 12) + 1, 0 }, { 0, 1 },
                  { 1 << 29, 0 },       { -(1 << 29), 0 } };
    trial t;

    for (int axis = 0; axis < 2; axis++)
        for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
            front_trial(&t);
            t.a.x[axis] = cases[i].x;
            expect(&t, cases[i].visible);
        }
}

/* With x/z = +-2 and a focal length of 2^14 px the mean is 2^15 px from the
 * picture's centre, which is the limit. */
TEST(mean_should_be_cut_at_32768_px)
{
    trial t;

    for (int axis = 0; axis < 2; axis++)
        for (int sign = -1; sign <= 1; sign += 2) {
            front_trial(&t);
            t.cam.focal_q16[axis] = 1 << 30;
            t.a.x[axis] = sign * 8192;
            expect(&t, 1);
            assert_int_equal(t.s.mean_q8[axis], (32 << 8) + sign * (1 << 23));
            t.cam.principal_q16[axis] += sign * 256;
            expect(&t, 0);
            t.cam.principal_q16[axis] -= sign * 512;
            expect(&t, 1);
        }
}

TEST(opacity_should_be_cut_at_eight)
{
    trial t;

    front_trial(&t);
    t.cam.principal_q16[0] = t.cam.principal_q16[1] = 7 << 15; /* 3.5 px */
    t.a.q0_q20 = CUT;
    expect(&t, 0);
    t.a.q0_q20 = INT32_MAX;
    expect(&t, 0);
    t.a.q0_q20 = CUT - 1;
    expect(&t, 1);
    assert_true(t.s.x0 <= 3 && t.s.x1 > 3 && t.s.y0 <= 3 && t.s.y1 > 3);
    t.a.log2_scale_q10[0] = t.a.log2_scale_q10[1] = -32768; /* a point */
    t.a.log2_scale_q10[2] = -32768;
    expect(&t, 1);
    assert_int_equal(t.s.x0, 3);
    assert_int_equal(t.s.x1, 4);
    assert_int_equal(t.s.y0, 3);
    assert_int_equal(t.s.y1, 4);
}

TEST(quaternion_should_count_by_direction_alone)
{
    static const int32_t quats[][4] = {
        { 1 << 30, 0, 0, 0 }, { 1, 0, 0, 0 }, { 0, 0, 0, 0 }, { -7, 0, 0, 0 }
    };
    trial t, first;

    front_trial(&first);
    first.a.log2_scale_q10[0] = 9 << 10;
    first.a.log2_scale_q10[1] = 7 << 10;
    expect(&first, 1);
    for (size_t i = 0; i < sizeof quats / sizeof *quats; i++) {
        t = first;
        memcpy(t.a.quat, quats[i], sizeof t.a.quat);
        expect(&t, 1);
        assert_memory_equal(t.s.chol_q28, first.s.chol_q28, 12);
    }
}

/* --- Boxes --------------------------------------------------------------- */

static int is_in_box(const saga_splat *s, int x, int y)
{
    return x >= s->x0 && x < s->x1 && y >= s->y0 && y < s->y1;
}

static void check_box(const trial *t, long *outside)
{
    const saga_splat *const s = &t->s;

    assert_true(0 <= s->x0 && s->x0 < s->x1 && s->x1 <= t->cam.width);
    assert_true(0 <= s->y0 && s->y0 < s->y1 && s->y1 <= t->cam.height);
    for (int y = 0; y < t->cam.height; y++)
        for (int x = 0; x < t->cam.width; x++)
            if (!is_in_box(s, x, y)) {
                assert_true(ref_q_q20(s, x, y, tools) >= CUT);
                ++*outside;
            }
}

TEST(box_should_lose_no_pixel)
{
    gen_rng r = gen_seeded(24);
    long outside = 0;
    trial t;

    for (int i = 0; i < ROUNDS / 4; i++) {
        tools = i & 1 ? SAGA_TOOL_STEEP : 0;
        small_trial(&t, &r, 48);
        if (t.is_visible)
            check_box(&t, &outside);
    }
    tools = 0;
    print_message("%ld pixels outside of boxes, none touched\n", outside);
    assert_true(outside > ROUNDS);
}

/* If q0 <= 9, the box may exceed the exact one by at most 3 % and 1.5 px. */
TEST(box_should_be_tight)
{
    gen_rng r = gen_seeded(25);
    trial t;
    int n = 0;

    for (int i = 0; i < ROUNDS / 4; i++) {
        tools = i & 1 ? SAGA_TOOL_STEEP : 0;
        hard_trial(&t, &r, 4096, 4096);
        if (!t.is_visible || t.a.q0_q20 > 9 << 20 ||
            fmin(focal(&t, 0), focal(&t, 1)) < 64)
            continue;
        for (int k = 0; k < 2; k++) {
            const double sigma = sqrt(t.ref.cov[2 * k] / 0.7213475204444817);
            const double rest = 11 - t.ref.q0;
            const double s = tools ? sqrt(1 + 2 * rest) - 1 : rest;
            const double reach = sqrt(s) * sigma * 1.03 + 1.5;
            const int lo = k ? t.s.y0 : t.s.x0, hi = k ? t.s.y1 : t.s.x1;

            assert_true(lo == 0 || lo + 0.5 >= t.ref.mean[k] - reach);
            assert_true(hi == 4096 || hi - 0.5 <= t.ref.mean[k] + reach);
        }
        n++;
    }
    tools = 0;
    assert_true(n > ROUNDS / 100);
}

/* --- Anything valid ------------------------------------------------------ */

static int32_t extreme(gen_rng *r, int32_t lo, int32_t hi)
{
    const int kind = gen_int(r, 0, 4);

    return kind == 0 ? lo : kind == 1 ? hi : gen_int(r, lo, hi);
}

static void valid_row(int32_t *row, gen_rng *r)
{
    int32_t left = 1859828213;
    const int first = gen_int(r, 0, 2);

    for (int i = 0; i < 3; i++) {
        const int32_t x = extreme(r, 0, left);

        row[(first + i) % 3] = gen_int(r, 0, 1) ? x : -x;
        left -= x;
    }
}

static void valid_camera(saga_camera *c, gen_rng *r)
{
    memset(c, 0, sizeof *c);
    for (int i = 0; i < 3; i++) {
        valid_row(c->rotation_q30 + 3 * i, r);
        c->centre[i] = extreme(r, -(1 << 29), 1 << 29);
    }
    for (int i = 0; i < 2; i++) {
        c->focal_q16[i] = gen_int(r, 0, 3) ? gen_shifted(r, 1, INT32_MAX, 30)
                                           : extreme(r, 1, INT32_MAX);
        c->focal_q16[i] |= 1;
        c->principal_q16[i] = extreme(r, -(1 << 30), 1 << 30);
    }
    c->near_plane = gen_int(r, 0, 3) ? 1 : extreme(r, 1, 1 << 20);
    c->width = (uint16_t)extreme(r, 1, 16384);
    c->height = (uint16_t)extreme(r, 1, 16384);
}

static void valid_animated(saga_animated *a, gen_rng *r, const saga_camera *c)
{
    const int32_t reach = 1 << 29 >> gen_int(r, 0, 29);

    for (int i = 0; i < 3; i++) {
        const int64_t x = (int64_t)c->centre[i] + extreme(r, -reach, reach);

        a->x[i] = x < -(1 << 29) ? -(1 << 29)
                  : x > 1 << 29  ? 1 << 29
                                 : (int32_t)x;
        a->log2_scale_q10[i] = extreme(r, -32768, 32767);
    }
    for (int i = 0; i < 4; i++)
        a->quat[i] = extreme(r, -(1 << 30), 1 << 30);
    a->q0_q20 = extreme(r, 0, CUT - 1);
}

/* No shift, sum or product may overflow, which -DSAGA_CHECK and the sanitizers
 * detect, and no factor may exceed sqrt(k / d) = 2.686. */
TEST(results_should_be_bounded_for_every_valid_input)
{
    const int32_t top = (int32_t)(2.6858 * 268435456);
    gen_rng r = gen_seeded(26);
    int n = 0;
    trial t;

    for (int i = 0; i < ROUNDS; i++) {
        valid_camera(&t.cam, &r);
        valid_animated(&t.a, &r, &t.cam);
        assert_ok(saga_camera_check(&t.cam));
        assert_true(is_in_front(&t) || !saga_project(&t.s, &t.a, &t.cam, 0));
        if (!saga_project(&t.s, &t.a, &t.cam, 0))
            continue;
        assert_true(t.s.chol_q28[0] >= 0 && t.s.chol_q28[0] <= top);
        assert_true(abs(t.s.chol_q28[1]) <= top);
        assert_true(t.s.chol_q28[2] >= 0 && t.s.chol_q28[2] <= top);
        assert_true(t.s.depth >= (uint32_t)t.cam.near_plane);
        assert_true(0 <= t.s.x0 && t.s.x0 < t.s.x1 && t.s.x1 <= t.cam.width);
        assert_true(0 <= t.s.y0 && t.s.y0 < t.s.y1 && t.s.y1 <= t.cam.height);
        n++;
    }
    print_message("%d visible\n", n);
    assert_true(n > ROUNDS / 100);
}
