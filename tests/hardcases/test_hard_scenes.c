/* SPDX-License-Identifier: MIT
 *
 * Hard cases of the picture: primitives and cameras at the limits of the
 * format, each in a file of its own that is encoded, decoded and drawn. Each
 * test compares the picture with a formula or invariant, which it states, and
 * with the picture in double. README.md in this folder has the table.
 */
#include "gen_scene.h"
#include "given_view.h"
#include "model.h"
#include "testing.h"

/* The side of pictures is odd, so that the axis of the camera goes through the
 * centre of pixel (SIDE / 2, SIDE / 2). */
enum { SIDE = 65, MIDDLE = SIDE / 2, DEPTH = 1 << 20, MID = 32768 };
enum {
    STILL = 0,
    FADES = SAGA_TOOL_OPACITY_T,
    MOVES = 3 << SAGA_TOOL_MOTION_SHIFT
};

static const double cap = SAGA_ALPHA_CAP_Q16 / 65536.0;

/* Returns a camera with a black background and a focal length equal to its
 * width. */
static saga_camera front(int width, int height)
{
    saga_camera c;

    gen_front_camera(&c, width, height);
    memset(c.background_q15, 0, sizeof c.background_q15);
    return c;
}

static gen_given ball(int log2_scale)
{
    return gen_given_ball(DEPTH, log2_scale);
}

static void set_scales(gen_given *g, double x, double y, double z)
{
    g->p.log2_scale_q10[0] = (int16_t)(1024 * x);
    g->p.log2_scale_q10[1] = (int16_t)(1024 * y);
    g->p.log2_scale_q10[2] = (int16_t)(1024 * z);
}

static void set_quat(gen_given *g, int w, int x, int y, int z)
{
    const int q[4] = { w, x, y, z };

    for (int i = 0; i < 4; i++)
        g->p.quat[i] = (int16_t)q[i];
}

/* Draws a picture, which must be close to the one in double. */
static void see(given_view *v, const saga_camera *c, int32_t t)
{
    saga_verify_picture p;

    given_draw(v, c, t);
    p = given_verify(v, SAGA_VERIFY_SYMBOLS);
    print_message("  %.1f dB, at most %d; %.1f dB, at most %d without %d "
                  "pixels that are cut or stopped otherwise\n",
                  p.psnr, p.max, p.psnr_same, p.max_same,
                  (int)(p.n_cut + p.n_stop));
    assert_true(p.psnr >= 62);
    assert_true(p.max <= 1);
}

static void see_one(given_view *v, const gen_given *g, uint32_t tools,
                    const saga_camera *c, int32_t t)
{
    given_open(v, g, 1, tools);
    see(v, c, t);
}

/* Checks that a pixel has the grey value `part`, from 0 to 1. */
static void expect(const given_view *v, int x, int y, double part)
{
    const double alpha = part * 8 /
                         (1 + exp2(3 - ldexp(GIVEN_FULL, -GIVEN_Q_OPACITY)));
    const double want = 255 * (alpha < 1.0 / 256 ? 0 : fmin(alpha, cap));

    for (int i = 0; i < 3; i++)
        assert_true(fabs(given_sample(v, x, y, i) - want) <= 0.6);
}

static void expect_all(const given_view *v, double part)
{
    for (int y = 0; y < v->cam.height; y++)
        for (int x = 0; x < v->cam.width; x++)
            expect(v, x, y, part);
}

static void expect_nothing(const given_view *v)
{
    assert_int_equal(v->report.n_splats, 0);
    expect_all(v, 0);
}

static void expect_same(const given_view *a, const given_view *b)
{
    assert_memory_equal(a->rgb, b->rgb, 3u * a->cam.width * a->cam.height);
}

/* --- Shapes -------------------------------------------------------------- */

/* Only the direction of a quaternion may matter. A zero quaternion must give
 * the picture of the identity, and so must w = 1 and a half turn about an axis
 * of the ellipsoid. (1, 0, 0, 1) must turn by a right angle like
 * (512, 0, 0, 512). */
TEST(zero_quaternion_should_be_the_identity)
{
    static const int same[][4] = { { 0, 0, 0, 0 },    { 1, 0, 0, 0 },
                                   { -1, 0, 0, 0 },   { 0, 1, 0, 0 },
                                   { 0, 0, 1, 0 },    { 0, 0, 0, 1 },
                                   { 0, 0, 0, -2047 } };
    const saga_camera c = front(SIDE, SIDE);
    gen_given g = ball(0);
    given_view v, w;

    set_scales(&g, 18, 16.5, 14);
    see_one(&v, &g, STILL, &c, MID);
    for (size_t i = 0; i < sizeof same / sizeof *same; i++) {
        set_quat(&g, same[i][0], same[i][1], same[i][2], same[i][3]);
        see_one(&w, &g, STILL, &c, MID);
        expect_same(&v, &w);
        given_close(&w);
    }
    given_close(&v);
    set_quat(&g, 1, 0, 0, 1);
    see_one(&v, &g, STILL, &c, MID);
    set_quat(&g, 512, 0, 0, 512);
    see_one(&w, &g, STILL, &c, MID);
    expect_same(&v, &w);
    given_close(&v);
    given_close(&w);
}

/* The quaternion is (1, 0, 0, 0) at the temporal centre, and w falls by 1 for
 * each unit of age, so that it is zero half a segment later. The picture there
 * must be that of the identity, without a division by zero. */
TEST(quaternion_should_pass_through_zero)
{
    const saga_camera c = front(SIDE, SIDE);
    saga_animated a;
    gen_given g = ball(0);
    given_view v, w;

    set_scales(&g, 18, 16.5, 14);
    g.p.t_centre = 0;
    see_one(&v, &g, SAGA_TOOL_SLOPE, &c, 32768);
    g.p.slope[0] = -(1 << GIVEN_Q_QUAT);
    see_one(&w, &g, SAGA_TOOL_SLOPE, &c, 32768);
    assert_ok(saga_primitive_at(&a, w.dec, 0, 32768));
    assert_int_equal(a.quat[0] | a.quat[1] | a.quat[2] | a.quat[3], 0);
    expect_same(&v, &w);
    given_close(&v);
    given_close(&w);
}

/* A primitive that is a point in the picture must be drawn as the low-pass
 * alone, 0.1 px^2, whether it is small, far away, or both. */
TEST(points_should_be_the_low_pass)
{
    static const int scales[] = { 3, -1, -20, -31 };
    const saga_camera c = front(SIDE, SIDE);

    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        const gen_given g = ball(scales[i]);
        FREED_BY(given_close) given_view v;

        see_one(&v, &g, STILL, &c, MID);
        for (int d = 0; d <= 3; d++) {
            expect(&v, MIDDLE + d, MIDDLE, exp(-d * d / 0.2));
            expect(&v, MIDDLE - d, MIDDLE + d, exp(-2 * d * d / 0.2));
        }
    }
}

/* A primitive whose standard deviations are 16 times the picture and more must
 * fill it with one grey value, that of the cap of alpha. */
TEST(scene_wide_scales_should_fill_the_picture)
{
    static const int scales[] = { 24, 28, 31 };
    const saga_camera c = front(SIDE, SIDE);

    for (size_t i = 0; i < sizeof scales / sizeof *scales; i++) {
        const gen_given g = ball(scales[i]);
        FREED_BY(given_close) given_view v;

        see_one(&v, &g, STILL, &c, MID);
        expect_all(&v, 1);
    }
}

/* The axes of a needle have the ratio 10^4, or 2^13.3125. A needle along x must
 * fall off as exp(-d^2 / 2 sigma^2) with sigma = 13.2 px along x, and like a
 * point along y. A needle along z must be a point. */
TEST(needles_should_be_a_line_from_the_side)
{
    const saga_camera c = front(SIDE, SIDE);
    const double thin = 17.6875 - 13.3125, sigma = SIDE * exp2(17.6875 - 20);
    gen_given g = ball(0);
    given_view v;

    set_scales(&g, 17.6875, thin, thin);
    see_one(&v, &g, STILL, &c, MID);
    for (int d = -30; d <= 30; d++) {
        const double alpha = exp(-d * d / (2 * (sigma * sigma + 0.1)));

        expect(&v, MIDDLE + d, MIDDLE, alpha);
        expect(&v, MIDDLE + d, MIDDLE + 1, alpha * exp(-1 / 0.2));
    }
    given_close(&v);
    set_scales(&g, thin, thin, 17.6875);
    see_one(&v, &g, STILL, &c, MID);
    expect(&v, MIDDLE, MIDDLE, 1);
    expect(&v, MIDDLE, MIDDLE + 1, exp(-1 / 0.2));
    given_close(&v);
}

/* Needles of 30 and of 30,000 px in all directions, near the camera's axis and
 * far from it, must equal those in double. */
TEST(turned_needles_should_be_those_of_double)
{
    const saga_camera c = front(SIDE, SIDE);
    gen_rng r = gen_seeded(51);

    for (int i = 0; i < 24; i++) {
        const double wide = i & 1 ? 28 : 18;
        gen_given g = ball(0);
        FREED_BY(given_close) given_view v;

        set_scales(&g, wide, wide - 13.3125, wide - 13.3125);
        for (int k = 0; k < 4; k++)
            g.p.quat[k] = (int16_t)gen_int(&r, -1000, 1000);
        for (int k = 0; k < 2; k++)
            g.p.x[k] = gen_int(&r, -DEPTH / 2, DEPTH / 2);
        see_one(&v, &g, STILL, &c, MID);
    }
}

/* --- Where they are ------------------------------------------------------ */

/* A primitive on the near plane must be drawn. One box unit nearer, at the
 * camera's place and behind it, it must not be drawn. */
TEST(near_plane_should_decide_by_a_unit)
{
    static const int32_t behind[] = { 1023, 1, 0, -1, -1024, -(1 << 22) };
    const saga_camera c = front(SIDE, SIDE);

    for (size_t i = 0; i < 2; i++) {
        const gen_given g = gen_given_ball(1024, i ? 14 : 9);
        FREED_BY(given_close) given_view v;

        see_one(&v, &g, STILL, &c, MID);
        assert_int_equal(v.report.n_splats, 1);
        expect(&v, MIDDLE, MIDDLE, 1);
    }
    for (size_t i = 0; i < sizeof behind / sizeof *behind; i++) {
        const gen_given g = gen_given_ball(behind[i], 9);
        FREED_BY(given_close) given_view v;

        see_one(&v, &g, STILL, &c, MID);
        expect_nothing(&v);
    }
}

/* The camera is inside a ball with a radius of 2^20. The ball must be drawn if
 * and only if its centre is in front of the camera. It must then fill the
 * picture, even at a depth of one box unit. */
TEST(camera_inside_should_see_what_is_before_it)
{
    static const struct {
        int32_t depth;
        int seen;
    } cases[] = { { 1 << 18, 1 }, { 1 << 14, 1 }, { 1, 1 },
                  { 0, 0 },       { -1, 0 },      { -(1 << 18), 0 } };
    saga_camera c = front(SIDE, SIDE);

    c.near_plane = 1;
    for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
        const gen_given g = gen_given_ball(cases[i].depth, 20);
        FREED_BY(given_close) given_view v;

        see_one(&v, &g, STILL, &c, MID);
        assert_int_equal(v.report.n_splats, cases[i].seen);
        if (cases[i].depth < 1 << 18)
            expect_all(&v, cases[i].seen);
    }
}

/* A camera is as far away as the format allows, 2^29 along an axis and
 * sqrt(3) 2^29 in a corner, with the longest focal length, 2^15 px. A ball of
 * 2^18 is 16 px wide there and must have the grey value of its formula. */
TEST(farthest_camera_should_see_through_the_longest_lens)
{
    const gen_given g = gen_given_ball(0, 18);
    const double sigma2 = 16 * 16 + 0.1;
    saga_camera c = front(SIDE, SIDE);
    FREED_BY(given_close) given_view v;

    c.focal_q16[0] = c.focal_q16[1] = INT32_MAX;
    c.centre[2] = -(1 << 29);
    see_one(&v, &g, STILL, &c, MID);
    for (int d = 0; d <= MIDDLE; d++)
        expect(&v, MIDDLE + d, MIDDLE - d, exp(-2 * d * d / (2 * sigma2)));
    c.centre[0] = c.centre[1] = -(1 << 29);
    for (int d = 0; d < 3; d++) {
        static const double axes[3][3] = {
            { 0.7071067811865476, -0.7071067811865476, 0 },
            { 0.408248290463863, 0.408248290463863, -0.816496580927726 },
            { 0.5773502691896257, 0.5773502691896257, 0.5773502691896257 }
        };

        for (int i = 0; i < 3; i++)
            c.rotation_q30[3 * d + i] = (int32_t)lrint(axes[d][i] * (1 << 30));
    }
    see(&v, &c, MID);
    for (int d = 0; d <= MIDDLE; d++)
        expect(&v, MIDDLE, MIDDLE + d,
               exp(-d * d / (2 * (16 * 16 / 3.0 + 0.1))));
}

/* A motion of 8 supports of half a cube for each unit of age must move the
 * primitive by 2^26 box units in half a segment, out of the cube. */
TEST(motion_should_leave_the_cube)
{
    static const int32_t times[] = { 0, 8192, 32768, 65535 };
    saga_camera c = front(SIDE, SIDE);
    gen_given g = gen_given_ball(0, 17);
    saga_animated a;
    FREED_BY(given_close) given_view v;

    g.p.t_centre = 0;
    g.p.support[0] = 1 << 23;
    g.p.motion[0] = 8 << GIVEN_Q_MOTION;
    given_open(&v, &g, 1, MOVES);
    c.centre[2] = -DEPTH;
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        c.centre[0] = times[i] << 11;
        see(&v, &c, times[i]);
        assert_ok(saga_primitive_at(&a, v.dec, 0, times[i]));
        assert_int_equal(a.x[0], times[i] << 11);
        expect(&v, MIDDLE, MIDDLE, 1);
    }
}

/* The largest motion of all orders must saturate at +-2^29, a place where a
 * camera can be. */
TEST(motion_should_end_where_cameras_end)
{
    saga_camera c = front(SIDE, SIDE);
    gen_given g = gen_given_ball(0, 17);
    saga_animated a;
    FREED_BY(given_close) given_view v;

    g.p.t_centre = 0;
    for (int i = 0; i < 3; i++)
        g.p.support[i] = 1 << 23;
    for (int i = 0; i < 9; i++)
        g.p.motion[i] = i % 3 == 0 ? 32752 : i % 3 == 1 ? -32752 : 0;
    given_open(&v, &g, 1, MOVES);
    c.centre[0] = 1 << 29;
    c.centre[1] = -(1 << 29);
    c.centre[2] = -DEPTH;
    see(&v, &c, 65535);
    assert_ok(saga_primitive_at(&a, v.dec, 0, 65535));
    assert_int_equal(a.x[0], 1 << 29);
    assert_int_equal(a.x[1], -(1 << 29));
    expect(&v, MIDDLE, MIDDLE, 1);
}

/* View directions are those at the middle of the segment. A camera that is at
 * the primitive's place then has no direction, and the colour must be that of
 * F_color's first part alone. */
TEST(camera_at_the_place_should_add_no_direction)
{
    const saga_camera c = front(SIDE, SIDE);
    gen_given g = gen_given_ball(0, 18);
    FREED_BY(given_close) given_view v;

    g.p.t_centre = 32768;
    g.p.support[2] = 1 << 21;
    g.p.motion[2] = 1 << GIVEN_Q_MOTION; /* moves by 2^21 until the end */
    g.colour_q15[0] = 8192;
    g.colour_q15[1] = 16384;
    g.colour_q15[2] = 0;
    see_one(&v, &g, SAGA_TOOL_VIEW | 1 << SAGA_TOOL_MOTION_SHIFT, &c, 65535);
    assert_int_equal(given_sample(&v, MIDDLE, MIDDLE, 0), 63); /* 255 cap/4 */
    assert_int_equal(given_sample(&v, MIDDLE, MIDDLE, 1), 126);
    assert_int_equal(given_sample(&v, MIDDLE, MIDDLE, 2), 0);
}

/* --- How much of them there is ------------------------------------------- */

/* With alpha = 8 / (1 + 2^(3 - o)), the lowest opacity must draw nothing and
 * the highest must reach the cap. The cut is between o = -8, whose q is
 * 11.0007, and o = -8 + 1/64, whose q is 10.985. The latter must draw only the
 * pixels within 0.14 standard deviations of its centre. */
TEST(opacity_should_be_nothing_cut_or_cap)
{
    static const int16_t nothing[] = { -32, -16, -8 };
    const saga_camera c = front(SIDE, SIDE);
    const double q0 = log2(1 + exp2(11 - 1 / 64.0));
    const double sigma = SIDE / 2.0;
    gen_given g = ball(19);
    given_view v;

    for (int i = 0; i < 3; i++) {
        g.p.opacity = (int16_t)(nothing[i] * (1 << GIVEN_Q_OPACITY) + 16 * !i);
        see_one(&v, &g, STILL, &c, MID);
        expect_nothing(&v);
        given_close(&v);
    }
    g.p.opacity = -8 * (1 << GIVEN_Q_OPACITY) + 16;
    see_one(&v, &g, STILL, &c, MID);
    assert_int_equal(v.report.n_splats, 1);
    for (int y = 0; y < SIDE; y++)
        for (int x = 0; x < SIDE; x++) {
            const int dx = x - MIDDLE, dy = y - MIDDLE;
            const double q = q0 + (dx * dx + dy * dy) / 2 / log(2) /
                                      (sigma * sigma + 0.1);

            assert_int_equal(given_sample(&v, x, y, 0), q < 11);
        }
    given_close(&v);
    g.p.opacity = 31 << GIVEN_Q_OPACITY;
    see_one(&v, &g, STILL, &c, MID);
    expect(&v, MIDDLE, MIDDLE, 1);
    given_close(&v);
}

/* 256 primitives of each of eight colours are at one place, with an alpha of
 * 8/1025 all over the picture. They must be drawn by their numbers. Then the
 * first colour has the weight 1 - T and the k-th one T^(k-1) (1 - T), where
 * T = (1017/1025)^256, until T^k is below 2^-13. Weights below half a unit of
 * 2^-16 are 0, so that T stays at 64, a quarter of a level more than in
 * double. */
TEST(coincident_splats_should_be_drawn_by_number)
{
    const double all = pow(1017 / 1025.0, 256);
    gen_given g[8];
    saga_camera c = front(9, 7);
    saga_splat s;
    FREED_BY(given_close) given_view v;
    double want[3] = { 0, 0, 0 };

    for (uint32_t i = 0; i < 8; i++) {
        g[i] = gen_given_ball(0, 28);
        g[i].p.opacity = -7 * (1 << GIVEN_Q_OPACITY);
        g[i].copies = 256;
        for (int k = 0; k < 3; k++)
            g[i].colour_q15[k] = i >> k & 1u ? 32768 : 4096;
    }
    c.centre[2] = -DEPTH;
    given_open(&v, g, 8, STILL);
    given_draw(&v, &c, MID);
    assert_true(given_verify(&v, SAGA_VERIFY_SYMBOLS).max <= 1);
    assert_int_equal(v.report.n_splats, 2048);
    for (uint32_t i = 0; i < 2048; i++) {
        assert_ok(saga_splat_at(&s, v.dec, i));
        assert_int_equal(s.depth, DEPTH);
        assert_int_equal(s.colour_q15[0], v.p[i / 256].colour_q15[0]);
    }
    for (uint32_t i = 0; i < 5; i++) /* the fifth ends after 135 splats */
        for (int k = 0; k < 3; k++)
            want[k] += (pow(all, i) - (i < 4 ? pow(all, i + 1) : exp2(-13))) *
                       v.p[i].colour_q15[k] / 32768;
    for (int k = 0; k < 3; k++)
        assert_true(fabs(given_sample(&v, 4, 3, k) - 255 * want[k]) <= 1);
}

/* --- Time ---------------------------------------------------------------- */

/* The temporal width is one frame of a thousand, 64 units. alpha must be
 * exp(-u^2) at a distance of u widths, and 0 from u = sqrt(log 256) = 2.355
 * on. */
TEST(width_of_a_frame_should_last_a_frame)
{
    static const int32_t away[] = { 0, 1, 32, 64, 128, 150, 151, 1000, 32767 };
    const saga_camera c = front(9, 7);
    gen_given g = ball(28);
    FREED_BY(given_close) given_view v;

    g.p.log2_width_q10 = 6 << 10;
    given_open(&v, &g, 1, FADES);
    for (size_t i = 0; i < sizeof away / sizeof *away; i++) {
        const double u = away[i] / 64.0;

        see(&v, &c, 32768 - away[i]);
        expect_all(&v, exp(-u * u));
        see(&v, &c, 32768 + away[i]);
        expect_all(&v, exp(-u * u));
    }
}

/* The temporal width is a thousand segments, 2^26 units, so that u is at most
 * 2^-11, and the fade, 2^-22 log2(e), is below half a unit of q. The picture
 * must have the same bytes at all times. */
TEST(width_of_a_thousand_segments_should_not_fade)
{
    static const int32_t times[] = { 0, 1, 32767, 65535 };
    const saga_camera c = front(SIDE, SIDE);
    gen_given g = ball(18);
    given_view v, w;

    g.p.log2_width_q10 = 26 << 10;
    see_one(&v, &g, FADES, &c, MID);
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        see_one(&w, &g, FADES, &c, times[i]);
        expect_same(&v, &w);
        given_close(&w);
    }
    given_close(&v);
}

/* Temporal centres are half a segment before its start or after its end, with
 * widths of half a segment. alpha must be exp(-1) at the near end of the
 * segment, and 0 at the far end, since exp(-9) is below the cut. */
TEST(centres_outside_should_fade_into_the_segment)
{
    const saga_camera c = front(9, 7);

    for (int i = 0; i < 2; i++) {
        gen_given g = ball(28);
        FREED_BY(given_close) given_view v;

        g.p.t_centre = i ? 98272 : -32768;
        g.p.log2_width_q10 = 15 << 10;
        given_open(&v, &g, 1, FADES);
        see(&v, &c, i ? 65504 : 0);
        expect_all(&v, exp(-1));
        see(&v, &c, i ? 0 : 65535);
        expect_nothing(&v);
    }
}

/* A view at a time outside the segment must be refused, and the previous view
 * must stay valid. */
TEST(times_outside_should_be_refused)
{
    static const int32_t times[] = { -1, 65536, INT32_MIN, INT32_MAX };
    const saga_camera c = front(SIDE, SIDE);
    const gen_given g = ball(18);
    saga_animated a;
    saga_splat s;
    FREED_BY(given_close) given_view v;

    see_one(&v, &g, FADES, &c, MID);
    for (size_t i = 0; i < sizeof times / sizeof *times; i++) {
        assert_int_equal(saga_view(v.dec, &c, times[i]), SAGA_ERR_ARG);
        assert_int_equal(saga_primitive_at(&a, v.dec, 0, times[i]),
                         SAGA_ERR_ARG);
        assert_ok(saga_splat_at(&s, v.dec, 0));
        assert_int_equal(s.depth, DEPTH);
    }
}

/* --- The least and the most of everything -------------------------------- */

/* A file with one anchor, one primitive, one frame, and one camera with one
 * pixel must be drawn. */
TEST(one_of_everything_should_be_enough)
{
    const saga_camera c = front(1, 1);
    const gen_given g = ball(16);
    saga_segment seg;
    saga_camera rig;
    saga_info info;
    uint32_t number;
    FREED_BY(given_close) given_view v;

    see_one(&v, &g, FADES, &c, 0);
    assert_int_equal(v.report.n_coarse, 1);
    assert_int_equal(v.report.n_fine, 1);
    assert_int_equal(v.report.n_primitives, 1);
    expect(&v, 0, 0, 1);
    assert_ok(saga_probe(&info, v.bytes, v.nbytes));
    assert_int_equal(info.n_frames, 1);
    assert_ok(saga_find(&seg, v.bytes, v.nbytes, 999, 1000));
    assert_int_equal(seg.t, 65470); /* floor(65536 * 0.999) */
    assert_int_equal(saga_find(&seg, v.bytes, v.nbytes, 1, 1), SAGA_ERR_ARG);
    assert_ok(saga_rig(&rig, &number, v.bytes, v.nbytes, 0));
    assert_int_equal(saga_rig(&rig, &number, v.bytes, v.nbytes, 1),
                     SAGA_ERR_ARG);
}

/* Pictures with rows or columns of 16,384 pixels show a ball at each end and
 * one that fills everything. They must equal pictures in double. Both ends must
 * be bright, and equal except for the half pixel between the axis and the
 * middle of the row. */
TEST(longest_rows_should_be_drawn_to_both_ends)
{
    gen_given g[3];
    given_view v;

    for (int k = 0; k < 2; k++) {
        saga_camera c = front(16384, 16384);

        for (int i = 0; i < 3; i++) {
            g[i] = gen_given_ball(DEPTH + 64 * i, i < 2 ? 10 : 18);
            g[i].p.x[k] = i < 2 ? (1 - 2 * i) * (DEPTH / 2) : 0;
            g[i].colour_q15[i] = 0;
        }
        if (k) {
            c.width = 1;
            c.principal_q16[0] = 1 << 15;
        } else {
            c.height = 1;
            c.principal_q16[1] = 1 << 15;
        }
        given_open(&v, g, 3, STILL);
        see(&v, &c, MID);
        assert_int_equal(v.report.n_splats, 3);
        assert_true(given_sample(&v, k ? 0 : 16383, k ? 16383 : 0, 2) > 245);
        assert_true(given_sample(&v, 0, 0, 2) > 245);
        given_close(&v);
    }
}
