/* SPDX-License-Identifier: MIT
 *
 * Lenses and sizes at loading. OpenCV's distortion is compared with values
 * computed by hand, pictures made through a lens with the same pattern seen by
 * a pinhole; area averages and scaled intrinsics are checked, too.
 */
#include "capture_files.h"
#include "picture.h"
#include "remap.h"
#include "testing.h"

enum { W = 160, H = 120 };

typedef struct {
    double fx, fy, cx, cy, k1, k2, p1, p2, k3; /* OpenCV's order */
} lens;

static const lens barrel = { 130,  126,   83.5,   57.25, -0.21,
                             0.06, 0.004, -0.003, -0.012 };
static const lens pincushion = { 150,  151,    78,    62,  0.12,
                                 0.03, -0.002, 0.005, 0.01 };

/* --- The reference ------------------------------------------------------- */

/* OpenCV's formula: the radial factor times the point, plus p1 (2xy, r2 + 2y2)
 * plus p2 (r2 + 2x2, 2xy). */
static void distort(const lens *l, const double in[2], double out[2])
{
    const double x2 = in[0] * in[0], y2 = in[1] * in[1], xy = in[0] * in[1];
    const double r2 = x2 + y2, r4 = r2 * r2, r6 = r4 * r2;
    const double radial = 1 + l->k1 * r2 + l->k2 * r4 + l->k3 * r6;

    out[0] = in[0] * radial + (2 * l->p1 * xy + l->p2 * (r2 + 2 * x2));
    out[1] = in[1] * radial + (l->p1 * (r2 + 2 * y2) + 2 * l->p2 * xy);
}

/* Finds the direction of a distorted point by fixed-point iteration. */
static void undistort(const lens *l, const double to[2], double x[2])
{
    double y[2];

    x[0] = to[0];
    x[1] = to[1];
    for (int i = 0; i < 200; i++) {
        distort(l, x, y);
        x[0] += 0.7 * (to[0] - y[0]);
        x[1] += 0.7 * (to[1] - y[1]);
    }
    distort(l, x, y);
    assert_true(fabs(y[0] - to[0]) < 1e-12 && fabs(y[1] - to[1]) < 1e-12);
}

/* Returns the brightness of the scene in the direction (x, y, 1), 0..255. Each
 * channel has waves in a direction of its own, of 2 pi / 29 or more: at
 * least 27 pixels through these lenses, whose shortest focal length is 126. */
static double pattern(double x, double y, int channel)
{
    static const double a[3][2] = { { 29, 0 }, { 4, 27 }, { -20, 19 } };

    return 127.5 + 100 * sin(a[channel][0] * x + a[channel][1] * y + channel);
}

static void draw_through(const lens *l, uint8_t *rgb)
{
    for (int i = 0; i < W * H; i++) {
        const double seen[2] = { (i % W + 0.5 - l->cx) / l->fx,
                                 (i / W + 0.5 - l->cy) / l->fy };
        double d[2];

        undistort(l, seen, d);
        for (int k = 0; k < 3; k++)
            rgb[3 * i + k] = (uint8_t)(pattern(d[0], d[1], k) + 0.5);
    }
}

/* --- Captures ------------------------------------------------------------ */

static void write_capture(folder *f, const lens *l, int w, int h,
                          const uint8_t *rgb)
{
    bytes b = { 0 };

    assert_done(saga_png_write(folder_file(f, "a.png"), w, h, rgb, &error));
    put_text(&b,
             "{\"fl_x\": %.17g, \"fl_y\": %.17g, \"cx\": %.17g, "
             "\"cy\": %.17g, \"k1\": %.17g, \"k2\": %.17g, \"p1\": %.17g, "
             "\"p2\": %.17g, \"k3\": %.17g, \"camera_model\": \"OPENCV\", "
             "\"frames\": [{\"file_path\": \"a.png\", \"transform_matrix\": "
             "[[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]}]}",
             l->fx, l->fy, l->cx, l->cy, l->k1, l->k2, l->p1, l->p2, l->k3);
    write_bytes(f, "transforms.json", &b);
}

static saga_capture load_scaled(folder *f, int scale)
{
    saga_capture_options o = saga_capture_defaults();

    o.scale = scale;
    return load_with(f->path, &o);
}

/* Returns the mean of the pattern over the n x n full-size pixels that a pixel
 * of the view covers, each sampled at its centre. */
static double expected(const saga_source_view *v, int n, int x, int y,
                       int channel)
{
    double sum = 0;

    for (int i = 0; i < n * n; i++) {
        const double u = x + (i % n + 0.5) / n, w = y + (i / n + 0.5) / n;

        sum += pattern((u - v->cx) / v->fx, (w - v->cy) / v->fy, channel);
    }
    return sum / (n * n);
}

static void check_pattern(folder *f, const lens *l, int scale)
{
    static uint8_t rgb[3 * W * H];
    double worst = 0, sum[3] = { 0 }, squares = 0;
    FREED_BY(saga_capture_free) saga_capture c;
    const saga_source_view *v;
    int n;

    draw_through(l, rgb);
    write_capture(f, l, W, H, rgb);
    c = load_scaled(f, scale);
    v = c.views;
    n = v->width * v->height;
    for (int i = 0; i < 3 * n; i++) {
        const double e = saga_capture_frame(&c, 0, 0)[i] -
                         expected(v, scale, i / 3 % v->width, i / 3 / v->width,
                                  i % 3);

        worst = fmax(worst, fabs(e));
        squares += e * e / (3 * n);
        sum[i % 3] += e / n;
    }
    /* The tolerance covers two roundings to 8 bits, 1/2 each at most;
     * interpolation of waves of 27 pixels with height 100, (2 pi / 27)^2 / 8 of
     * the height on each axis, which is 0.7 and 0.7; and positions to 1/512
     * pixel, 0.1. An error of half a pixel would be 11. */
    assert_true(worst < 2.6);
    assert_true(squares < 0.6 * 0.6);
    for (int k = 0; k < 3; k++)
        assert_true(fabs(sum[k]) < 0.1);
}

/* --- Tests --------------------------------------------------------------- */

TEST(lens_should_give_values_worked_out_by_hand)
{
    /* By hand: k1 has r2 = 1/4 and a factor of 1 + 1/2 / 4; k2 has r4 = 1/16;
     * k3 has r2 = 1/2 and r6 = 1/8; p1 at (1/2, 1/2) gives x + 2 p1 / 4 and y +
     * p1 (1/2 + 2/4); p2 gives the same with x and y swapped. */
    static const struct {
        saga_lens lens;
        double x, y, u, v;
    } t[] = { { { .fx = 1, .fy = 1, .k1 = 0.5 }, 0.5, 0, 0.5625, 0 },
              { { .fx = 1, .fy = 1, .k2 = 1 }, 0, 0.5, 0, 0.53125 },
              { { .fx = 1, .fy = 1, .k3 = 1 }, 0.5, -0.5, 0.5625, -0.5625 },
              { { .fx = 1, .fy = 1, .p1 = 0.1 }, 0.5, 0.5, 0.55, 0.6 },
              { { .fx = 1, .fy = 1, .p2 = 0.1 }, 0.5, 0.5, 0.6, 0.55 },
              { { .fx = 100, .fy = 200, .cx = 7, .cy = 9, .p2 = 0.1 },
                0.5,
                0.5,
                67,
                119 } };

    for (size_t i = 0; i < sizeof t / sizeof t[0]; i++) {
        double uv[2];

        saga_lens_project(&t[i].lens, t[i].x, t[i].y, uv);
        assert_true(fabs(uv[0] - t[i].u) < 1e-12);
        assert_true(fabs(uv[1] - t[i].v) < 1e-12);
    }
}

TEST_IN_FOLDER(lens_should_be_gone_after_loading)
{
    check_pattern(f, &barrel, 1);
    check_pattern(f, &pincushion, 1);
}

TEST_IN_FOLDER(lens_should_be_gone_when_scaled_down)
{
    check_pattern(f, &barrel, 2);
    check_pattern(f, &pincushion, 3);
}

/* OpenCV's fisheye formula: the distance from the centre for an angle from the
 * axis. Its inverse is found by bisection. */
static const double fish_k[4] = { 0.03, -0.01, 0.004, -0.002 };

static double fish_radius(double angle)
{
    double power = angle, sum = angle;

    for (int i = 0; i < 4; i++) {
        power *= angle * angle;
        sum += fish_k[i] * power;
    }
    return sum;
}

static double fish_angle(double radius)
{
    double low = 0, high = 1.55;

    for (int i = 0; i < 60; i++) {
        const double middle = (low + high) / 2;

        if (fish_radius(middle) < radius)
            low = middle;
        else
            high = middle;
    }
    return low;
}

/* Writes a fisheye picture with `focal` pixels per radian, whose waves are
 * `slow` times longer. */
static void write_fisheye(folder *f, double focal, double slow)
{
    static uint8_t rgb[3 * W * H];
    bytes b = { 0 };

    for (int i = 0; i < W * H; i++) {
        const double x = (i % W + 0.5 - 81) / focal;
        const double y = (i / W + 0.5 - 58) / focal;
        const double r = hypot(x, y), part = tan(fish_angle(r)) / r / slow;

        for (int k = 0; k < 3; k++)
            rgb[3 * i + k] = (uint8_t)(pattern(x * part, y * part, k) + 0.5);
    }
    assert_done(saga_png_write(folder_file(f, "a.png"), W, H, rgb, &error));
    put_text(&b,
             "{\"fl_x\": %g, \"cx\": 81, \"cy\": 58, \"k1\": %g, \"k2\": "
             "%g, \"k3\": %g, \"k4\": %g, \"camera_model\": "
             "\"OPENCV_FISHEYE\", \"frames\": [{\"file_path\": \"a.png\", "
             "\"transform_matrix\": [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]"
             "}]}",
             focal, fish_k[0], fish_k[1], fish_k[2], fish_k[3]);
    write_bytes(f, "transforms.json", &b);
}

TEST_IN_FOLDER(fisheye_should_become_a_pinhole)
{
    /* With the first focal length the whole picture fits; with the second the
     * field of view is cut at 110 degrees. */
    static const double focal[] = { 120, 60 }, slow[] = { 1, 4 };

    for (int t = 0; t < 2; t++) {
        double worst = 0, widest;
        FREED_BY(saga_capture_free) saga_capture c;
        const saga_source_view *v;

        write_fisheye(f, focal[t], slow[t]);
        c = load_scaled(f, 1);
        v = c.views;
        for (int i = 0; i < 3 * W * H; i++) {
            const double x = (i / 3 % W + 0.5 - v->cx) / v->fx;
            const double y = (i / 3 / W + 0.5 - v->cy) / v->fy;

            worst = fmax(worst, fabs(saga_capture_frame(&c, 0, 0)[i] -
                                     pattern(x / slow[t], y / slow[t], i % 3)));
        }
        assert_true(worst < 2.6);
        widest = atan(v->cx / v->fx) * 180 / 3.14159265358979;
        assert_true(t == 0 ? widest > 30 && widest < 40
                           : fabs(widest - 55) < 0.1);
    }
}

/* Returns whether every pixel centre of the pinhole picture, with focal lengths
 * times s, falls between pixel centres of the source. */
static bool all_covered(const lens *l, const saga_source_view *v, double s)
{
    for (int i = 0; i < W * H; i++) {
        const double d[2] = { (i % W + 0.5 - v->cx) / (s * v->fx),
                              (i / W + 0.5 - v->cy) / (s * v->fy) };
        double at[2];

        distort(l, d, at);
        at[0] = l->fx * at[0] + l->cx;
        at[1] = l->fy * at[1] + l->cy;
        if (at[0] < 0.5 - 1e-9 || at[0] > W - 0.5 + 1e-9 ||
            at[1] < 0.5 - 1e-9 || at[1] > H - 0.5 + 1e-9)
            return false;
    }
    return true;
}

TEST_IN_FOLDER(pinhole_should_be_the_widest_without_invalid_pixels)
{
    static const lens *const all[] = { &barrel, &pincushion };
    static uint8_t rgb[3 * W * H];

    for (int i = 0; i < 2; i++) {
        FREED_BY(saga_capture_free) saga_capture c;
        const saga_source_view *v;

        write_capture(f, all[i], W, H, rgb);
        c = load_scaled(f, 1);
        v = c.views;
        assert_true(v->cx == all[i]->cx && v->cy == all[i]->cy);
        assert_true(v->fx == all[i]->fx * v->focal_scale);
        assert_true(v->fy == all[i]->fy * v->focal_scale);
        assert_true(all_covered(all[i], v, 1));
        assert_false(all_covered(all[i], v, 0.9999));
    }
}

TEST_IN_FOLDER(scale_should_average_areas_exactly)
{
    enum { FULL_W = 101, FULL_H = 50, N = 3, SMALL = FULL_W / N };
    static const lens none = { 90, 91, 50.5, 25, 0, 0, 0, 0, 0 };
    static uint8_t rgb[3 * FULL_W * FULL_H];
    const double world[3] = { 0.25, -0.125, -2 };
    double full[2], small[2] = { 0 }, z;
    saga_capture c;
    uint32_t seed = 1;

    for (size_t i = 0; i < sizeof rgb; i++) {
        seed = seed * 1664525u + 1013904223u;
        rgb[i] = (uint8_t)(seed >> 24);
    }
    write_capture(f, &none, FULL_W, FULL_H, rgb);
    c = load_scaled(f, N);
    assert_int_equal(c.views[0].width, SMALL);
    assert_int_equal(c.views[0].height, FULL_H / N);
    assert_int_equal(c.views[0].original_width, FULL_W);
    for (int i = 0; i < 3 * SMALL * (FULL_H / N); i++) {
        const int x = i / 3 % SMALL, y = i / 3 / SMALL;
        int sum = 0;

        for (int k = 0; k < N * N; k++)
            sum += rgb[3 * ((N * y + k / N) * FULL_W + N * x + k % N) + i % 3];
        /* The mean of nine pixels must be rounded to nearest; a ninth is never
         * a tie. */
        assert_true(abs(18 * saga_capture_frame(&c, 0, 0)[i] - 2 * sum) <= 9);
    }
    /* A place in the world must be at the same place relative to the picture's
     * corner. By hand, in pixels of the full picture: 50.5 + 90 / 8 and 25 + 91
     * / 16. */
    assert_true(saga_view_project(c.views, world, small, &z));
    saga_capture_free(&c);
    full[0] = 50.5 + 90 * 0.125;
    full[1] = 25 + 91 * 0.0625;
    assert_true(fabs(small[0] - full[0] / N) < 1e-12);
    assert_true(fabs(small[1] - full[1] / N) < 1e-12);
    assert_true(z == 2);
}

TEST(scale_should_take_single_depths)
{
    saga_remap r;
    const saga_lens none = { .fx = 9, .fy = 9, .cx = 4, .cy = 3 };
    float full[8 * 6], small[4 * 3];

    for (int i = 0; i < 8 * 6; i++)
        full[i] = (float)i;
    assert_done(saga_remap_plan(&r, &none, 8, 6, 2, "x", &error));
    assert_done(saga_remap_build(&r, &none, "x", &error));
    saga_remap_depth(&r, full, small);
    for (int i = 0; i < 4 * 3; i++)
        assert_true(small[i] == full[(2 * (i / 4) + 1) * 8 + 2 * (i % 4) + 1]);
    saga_remap_free(&r);
    assert_done(saga_remap_plan(&r, &none, 8, 6, 3, "x", &error));
    saga_remap_depth(&r, full, small);
    for (int i = 0; i < 2 * 2; i++)
        assert_true(small[i] == full[(3 * (i / 2) + 1) * 8 + 3 * (i % 2) + 1]);
}

TEST_IN_FOLDER(lens_should_be_refused_when_it_folds_or_is_no_lens)
{
    static uint8_t rgb[3 * W * H];
    lens l = barrel;

    l.k1 = -50;
    write_capture(f, &l, W, H, rgb);
    refused(f->path, "a.png: distortion k1 -50", "folds the picture");
    l = barrel;
    l.fx = -130;
    write_capture(f, &l, W, H, rgb);
    refused(f->path, "a.png", "fx -130");
    l.fx = 0;
    write_capture(f, &l, W, H, rgb);
    refused(f->path, "a.png", "fx 0");
}
