/* SPDX-License-Identifier: MIT
 *
 * The prediction of the quality between cameras, for a row of them before a
 * wall, with or without something that stands near, and for the built-in room.
 * There a camera that training does not see tells the truth. The result must
 * have the same bits for any number of threads, and is unknown if no camera
 * stands between others.
 */
#include "between.h"

#include "flat.h"
#include "miniature.h"
#include "pictures.h"
#include "tiny_training.h"

#ifdef _OPENMP
#include <omp.h>
#else
#define omp_set_num_threads(n) (void)(n)
#endif

enum { W = 48, H = 32, MOST_VIEWS = 7 };

static const double even[3 * (MOST_VIEWS + 1)] = { 1, 1, 1, 1, 1, 1, 1, 1,
                                                   1, 1, 1, 1, 1, 1, 1, 1,
                                                   1, 1, 1, 1, 1, 1, 1, 1 };

/* --- A row of cameras ---------------------------------------------------- */

/* Cameras that stand side by side and look along z, and their pictures. */
typedef struct {
    saga_capture capture;
    saga_source_view view[MOST_VIEWS];
    uint8_t rgb[MOST_VIEWS][3 * W * H], mask[MOST_VIEWS][W * H];
} row;

/* Returns the colour of a wall at z = 20, or of the bars at z = 4 before it, on
 * the ray through (x, 0, 0) in the direction (u, v, 1). */
static uint8_t colour_on(double x, double u, double v, bool bars, int k)
{
    const double near = x + 4 * u, far = x + 20 * u;

    if (bars && fmod(near + 100, 1.5) < 0.5)
        return (uint8_t)(60 * k + 40);
    return (uint8_t)(128 + 60 * sin(2 * far + k) * cos(40 * v));
}

static void film(row *r, int n, double step, bool bars)
{
    memset(r, 0, sizeof *r);
    r->capture = (saga_capture){
        .n_views = n, .n_frames = 1, .fps = 30, .views = r->view
    };
    for (int i = 0; i < n; i++) {
        saga_source_view *const v = &r->view[i];
        const double x = step * (i - (n - 1) / 2.0);

        *v = (saga_source_view){ .width = W,
                                 .height = H,
                                 .fx = W,
                                 .fy = W,
                                 .cx = W / 2.0,
                                 .cy = H / 2.0,
                                 .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
                                 .translation = { -x, 0, 0 },
                                 .near_depth = 3,
                                 .far_depth = 25,
                                 .rgb = r->rgb[i] };
        for (int at = 0; at < 3 * W * H; at++)
            r->rgb[i][at] = colour_on(x, (at / 3 % W + 0.5 - v->cx) / W,
                                      (at / 3 / W + 0.5 - v->cy) / W, bars,
                                      at % 3);
    }
}

/* Makes the middle of each picture, a quarter of its pixels, the only part that
 * counts, or a subject over black. */
static void mask_row(row *r, bool subject)
{
    r->capture.subject = subject;
    for (int i = 0; i < r->capture.n_views; i++) {
        r->view[i].mask = r->mask[i];
        for (int at = 0; at < W * H; at++) {
            const int x = at % W, y = at / W;
            const bool counts = x >= W / 4 && x < 3 * W / 4 && y >= H / 4 &&
                                y < 3 * H / 4;

            r->mask[i][at] = (uint8_t)(!counts ? 0 : subject ? 255 : 1);
            for (int k = 0; !counts && k < 3; k++)
                r->rgb[i][3 * at + k] = (uint8_t)(subject ? 0 : 50 * i);
        }
    }
}

/* Returns how much worse pictures are between the cameras of a row whose film
 * has 30 dB at them. */
static double lost_by(const row *r, int n_left_out)
{
    saga_between b;

    assert_done(saga_between_predict(&b, &r->capture, even, 30, 1, &error));
    assert_int_equal(b.n_views, n_left_out);
    return 30 - b.psnr;
}

static double loss_of(int n, double step, bool bars, int n_left_out)
{
    static row r;

    film(&r, n, step, bars);
    return lost_by(&r, n_left_out);
}

TEST(nothing_should_be_lost_before_a_far_wall)
{
    assert_true(fabs(loss_of(5, 0.02, false, 3)) < 0.3);
}

TEST(much_should_be_lost_behind_what_stands_near)
{
    assert_true(loss_of(5, 1.5, true, 3) > 4);
}

TEST(only_pixels_that_count_should_be_compared)
{
    static row r;

    film(&r, 5, 0.02, false);
    mask_row(&r, false);
    assert_true(fabs(lost_by(&r, 3)) < 0.3);
    /* The error of a subject is a mean over the pixels where it is. A mean over
     * all would be a quarter of it, so that 8 dB would be lost. */
    film(&r, 5, 1.5, true);
    mask_row(&r, true);
    assert_true(lost_by(&r, 3) > 11);
}

/* A camera from which nothing is seen that counts is no perfect one. */
TEST(a_camera_that_shows_nothing_should_not_count)
{
    static row r;
    double all;

    film(&r, 5, 1.5, true);
    mask_row(&r, false);
    all = lost_by(&r, 3);
    memset(r.mask[2], 0, sizeof r.mask[2]);
    /* As one of three it would take a third of the loss away. */
    assert_true(lost_by(&r, 2) > 0.8 * all);
}

TEST(no_camera_between_others_should_leave_it_unknown)
{
    assert_true(isnan(loss_of(1, 0.5, true, 0)));
    assert_true(isnan(loss_of(2, 0.5, true, 0)));
    assert_true(loss_of(3, 0.5, true, 1) >= 0);
}

/* --- A camera that tells the truth --------------------------------------- */

/* Returns the mean PSNR of the views that training saw, or of the others. */
static double psnr_of(saga_flat *f, const saga_capture *c, bool held_out)
{
    double sum = 0, mse;
    int n = 0;

    for (int v = 0; v < c->n_views; v++)
        if (c->views[v].held_out == held_out) {
            assert_done(saga_flat_render(f, NULL, &mse,
                                         (saga_sample){ .view = v }, &error));
            sum -= 10 * log10(mse);
            n++;
        }
    return sum / n;
}

TEST(the_prediction_should_be_right_for_the_room)
{
    saga_synth_options s = synth_options(80, 45, 8, 1, 300);
    saga_capture c = tiny_capture(&s);
    saga_flat_options o = saga_flat_defaults();
    saga_between one, three;
    saga_pictures p;
    saga_flat *f;
    saga_error failure = { "" };
    double mse, at;

    o.n_primitives = 700;
    o.n_iterations = 600;
    o.seed = 5;
    o.temporal = 0;
    assert_done(saga_pictures_init(&p, &c, &error));
    f = saga_flat_new(&p, &o, &failure);
    if (!f)
        fail_msg("%s", failure.message);
    for (int i = 0; i < o.n_iterations; i++)
        assert_done(saga_flat_iterate(f, &mse, &error));
    at = psnr_of(f, &c, false);
    omp_set_num_threads(1);
    assert_done(saga_between_predict(&one, &c, even, at, 1, &error));
    omp_set_num_threads(3);
    assert_done(saga_between_predict(&three, &c, even, at, 1, &error));
    print_message("%.2f dB at the cameras, between them %.2f, predicted %.2f\n",
                  at, psnr_of(f, &c, true), one.psnr);
    assert_true(fabs(one.psnr - psnr_of(f, &c, true)) < 1.5);
    assert_true(one.psnr < at);
    assert_true(one.psnr == three.psnr && one.n_views == three.n_views);
    saga_flat_free(f);
    saga_pictures_free(&p);
    saga_capture_free(&c);
}

/* --- Small pictures ------------------------------------------------------ */

TEST(a_miniature_should_have_the_means_of_boxes)
{
    enum { WIDE = 163, TALL = 91 };
    static uint8_t rgb[3 * WIDE * TALL], mask[WIDE * TALL];
    saga_source_view views[2] = { { .held_out = true },
                                  { .width = WIDE,
                                    .height = TALL,
                                    .fx = 160,
                                    .fy = 160,
                                    .cx = 80,
                                    .cy = 45,
                                    .rgb = rgb,
                                    .mask = mask } };
    const saga_capture c = { .n_views = 2, .n_frames = 1, .views = views };
    saga_miniature m;

    for (size_t i = 0; i < sizeof rgb; i++)
        rgb[i] = (uint8_t)(i / 3 % WIDE + i % 3);
    memset(mask, 1, sizeof mask);
    mask[3 * WIDE + 5] = 0;
    assert_done(saga_miniature_make(&m, &c, &error));
    assert_int_equal(m.capture.n_views, 1);
    assert_int_equal(m.view[0], 1);
    assert_int_equal(m.capture.views[0].width, WIDE / 2);
    assert_int_equal(m.capture.views[0].height, TALL / 2);
    assert_true(m.capture.views[0].cx == 40 && m.capture.views[0].fx == 80);
    /* The box has columns 20 and 21, whose mean is rounded down. */
    assert_int_equal(m.capture.views[0].rgb[3 * (7 * (WIDE / 2) + 10) + 2], 22);
    for (int i = 0; i < WIDE / 2 * (TALL / 2); i++)
        assert_int_equal(m.capture.views[0].mask[i], i != WIDE / 2 + 2);
    saga_miniature_free(&m);
}
