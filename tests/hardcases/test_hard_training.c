/* SPDX-License-Identifier: MIT
 *
 * Hard cases of training: captures of the built-in room, changed in memory to
 * something that a loader may deliver but no camera ever filmed. Each is
 * trained to a file, which fails if a loss or a gradient is not finite, and the
 * file is decoded. README.md in this folder has the table.
 */
#include "capture.h"
#include "saga.h"
#include "testing.h"
#include "tiny_training.h"
#include "train.h"
#include "view.h"

#include <unistd.h>

enum { UNIT_NBYTES = 8, CRC_NBYTES = 7 * 4 };
enum { WIDTH = 64, HEIGHT = 36, VIEWS = 4, FRAMES = 3, POINTS = 200 };

/* --- A capture of one's own ---------------------------------------------- */

static saga_capture room;

static int set_up(void **state)
{
    saga_synth_options s = synth_options(WIDTH, HEIGHT, VIEWS, FRAMES, POINTS);

    (void)state;
    s.depth_every = 1;
    room = tiny_capture(&s);
    return 0;
}

static int tear_down(void **state)
{
    (void)state;
    saga_capture_free(&room);
    return 0;
}

/* Returns the room without its depths; saga_capture_free frees it. */
static saga_capture changed(void)
{
    saga_capture c = room;

    c.views = copy_of(room.views, VIEWS * sizeof *room.views);
    c.points = copy_of(room.points, room.n_points * sizeof *room.points);
    for (int v = 0; v < VIEWS; v++) {
        c.views[v].rgb = copy_of(room.views[v].rgb,
                                 FRAMES * saga_view_frame_nbytes(c.views + v));
        c.views[v].depth = NULL;
    }
    return c;
}

static void paint(saga_capture *c, int r, int g, int b)
{
    const uint8_t colour[3] = { (uint8_t)r, (uint8_t)g, (uint8_t)b };

    for (int v = 0; v < c->n_views; v++)
        for (int i = 0; i < FRAMES * WIDTH * HEIGHT * 3; i++)
            c->views[v].rgb[i] = colour[i % 3];
}

/* --- Trained ------------------------------------------------------------- */

static trained train(const saga_capture *c)
{
    const saga_train_options o = tiny_options(100, 30, 15);
    const trained r = tiny_train(c, &o);

    print_message("  %.2f dB, %zu bytes\n", r.report.coded.training, r.n);
    return r;
}

/* Draws every camera's first picture and sets the mean colour of all. */
static void draw_all(double mean[3], const trained *r)
{
    uint8_t rgb[3 * WIDTH * HEIGHT];
    FREED_BY(saga_film_close) saga_film film;

    mean[0] = mean[1] = mean[2] = 0;
    assert_done(saga_film_open(&film, "x", r->bytes, r->n, 1, &error));
    for (uint32_t v = 0; v < film.info.n_cameras; v++) {
        saga_camera camera;
        uint32_t number;

        assert_done(saga_film_rig(&film, v, &camera, &number, &error));
        assert_done(saga_film_draw(&film, &camera, 0, 1, rgb, &error));
        for (int i = 0; i < 3 * WIDTH * HEIGHT; i++)
            mean[i % 3] += rgb[i] / (double)(WIDTH * HEIGHT) /
                           film.info.n_cameras;
    }
}

/* Trains the capture, which must learn something, and frees it. */
static trained survive(saga_capture *c, double psnr)
{
    double mean[3];
    const trained r = train(c);

    draw_all(mean, &r);
    assert_true(r.report.coded.training >= psnr);
    saga_capture_free(c);
    return r;
}

/* --- Pictures ------------------------------------------------------------ */

/* A black capture must give black pictures, even if no primitive is drawn. */
TEST(black_capture_should_stay_black)
{
    FREED_BY(saga_capture_free) saga_capture c = changed();
    double mean[3];
    trained r;

    paint(&c, 0, 0, 0);
    r = train(&c);
    draw_all(mean, &r);
    for (int i = 0; i < 3; i++)
        assert_true(mean[i] < 2);
    free(r.bytes);
}

/* If all pictures have one colour, no place is better than another. The mean of
 * the drawn pictures must be this colour, although parts without primitives are
 * black. */
TEST(one_colour_should_come_out)
{
    static const int colours[][3] = { { 255, 255, 255 }, { 200, 100, 40 } };

    for (int k = 0; k < 2; k++) {
        FREED_BY(saga_capture_free) saga_capture c = changed();
        double mean[3];
        trained r;

        paint(&c, colours[k][0], colours[k][1], colours[k][2]);
        r = train(&c);
        draw_all(mean, &r);
        print_message("  %.0f %.0f %.0f\n", mean[0], mean[1], mean[2]);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(mean[i] - colours[k][i]) < 0.2 * colours[k][i]);
        free(r.bytes);
    }
}

/* Invalid depths of a capture (not a number, infinite, zero, negative,
 * denormal) must not harm the training. */
TEST(depths_should_be_doubted)
{
    static const float wrong[] = { NAN, INFINITY, -INFINITY, 0,
                                   -3,  1e-42f,   1e38f };
    saga_capture c = changed();
    trained r;

    for (int v = 0; v < VIEWS; v++) {
        c.views[v].depth = must(calloc(FRAMES, sizeof *c.views[v].depth));
        for (int k = 0; k < FRAMES; k++) {
            c.views[v].depth[k] = must(calloc(WIDTH * HEIGHT, sizeof(float)));
            for (int i = 0; i < WIDTH * HEIGHT; i++)
                c.views[v].depth[k][i] = wrong[i % 7];
        }
    }
    r = survive(&c, 10);
    free(r.bytes);
}

/* --- Points -------------------------------------------------------------- */

/* A capture's points may be on a line, all at one place, or missing. */
TEST(points_should_be_taken_as_they_lie)
{
    for (int k = 0; k < 3; k++) {
        saga_capture c = changed();
        trained r;

        for (size_t i = 0; i < c.n_points; i++)
            for (int a = 0; a < 3; a++)
                c.points[i].position[a] = c.points[0].position[a] +
                                          (k == 0 && a == 0) * 1e-3 * (double)i;
        if (k == 2)
            c.n_points = 0;
        r = survive(&c, 10);
        free(r.bytes);
    }
}

/* --- Cameras ------------------------------------------------------------- */

/* All cameras are at one place and look in the same direction, so that no depth
 * can be found. The training must succeed, with points and without, near the
 * origin and a million units away. */
TEST(identical_cameras_should_do)
{
    for (int k = 0; k < 4; k++) {
        saga_capture c = changed();
        trained r;

        for (int v = 0; v < VIEWS; v++) {
            saga_source_view *const s = c.views + v;

            memcpy(s->rotation, room.views[0].rotation, sizeof s->rotation);
            memcpy(s->translation, room.views[0].translation,
                   sizeof s->translation);
            if (k >= 2)
                s->translation[0] += 1e6;
            memcpy(s->rgb, room.views[0].rgb,
                   FRAMES * saga_view_frame_nbytes(s));
        }
        if (k & 1)
            c.n_points = 0;
        r = survive(&c, 10);
        free(r.bytes);
    }
}

/* The cameras look away from each other, so that no two show the same. */
TEST(opposite_cameras_should_do)
{
    saga_capture c = changed();
    trained r;

    for (int v = 0; v < VIEWS; v += 2) {
        for (int i = 0; i < 9; i++)
            c.views[v].rotation[i] *= i % 9 < 3 || i >= 6 ? -1 : 1;
        c.views[v].translation[0] *= -1;
        c.views[v].translation[2] *= -1;
    }
    c.n_points = 0;
    r = survive(&c, 8);
    free(r.bytes);
}

/* Returns the capture with the world s times as large. */
static saga_capture scaled(double s)
{
    saga_capture c = changed();

    for (int v = 0; v < VIEWS; v++) {
        for (int i = 0; i < 3; i++)
            c.views[v].translation[i] *= s;
        c.views[v].near_depth *= s;
        c.views[v].far_depth *= s;
    }
    for (size_t i = 0; i < c.n_points; i++)
        for (int a = 0; a < 3; a++)
            c.points[i].position[a] *= s;
    return c;
}

/* Returns the metres of a box unit in the file. */
static double unit_of(const trained *r)
{
    return ldexp(r->report.info.unit_mantissa, r->report.info.unit_exponent);
}

/* The scale of the world must not matter, because training measures lengths in
 * cubes. A scale of a power of two must change only the exponents of unit and
 * centre, and therefore the CRCs of the header and of its six chunks. A scale
 * of a million must not change the picture. */
TEST(scale_of_the_world_should_not_matter)
{
    static const double by[] = { 1, 0x1p20, 0x1p-20, 1e6, 1e-6 };
    trained r[5];

    for (int k = 0; k < 5; k++) {
        saga_capture c = scaled(by[k]);

        r[k] = survive(&c, 10);
        assert_true(fabs(unit_of(&r[k]) / unit_of(&r[0]) / by[k] - 1) < 1e-6);
    }
    for (int k = 1; k < 3; k++) {
        assert_int_equal(r[k].n, r[0].n);
        for (size_t i = 0, n_apart = 0; i < r[0].n; i++) {
            n_apart += r[k].bytes[i] != r[0].bytes[i];
            assert_true(n_apart <= UNIT_NBYTES + CRC_NBYTES);
        }
    }
    for (int k = 3; k < 5; k++)
        assert_true(fabs(r[k].report.coded.training -
                         r[0].report.coded.training) < 0.5);
    for (int k = 0; k < 5; k++)
        free(r[k].bytes);
}

/* The room must be trained as well if it is a million units from the origin of
 * the world. */
TEST(room_should_be_found_far_from_the_origin)
{
    saga_capture c = changed();
    const trained here = survive(&c, 10);
    trained r;

    c = changed();
    for (int v = 0; v < VIEWS; v++)
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++)
                c.views[v].translation[i] -= c.views[v].rotation[3 * i + k] *
                                             1e6;
    for (size_t i = 0; i < c.n_points; i++)
        for (int a = 0; a < 3; a++)
            c.points[i].position[a] += 1e6;
    r = survive(&c, 10);
    print_message("  unit times %.4f\n", unit_of(&r) / unit_of(&here));
    assert_true(fabs(unit_of(&r) / unit_of(&here) - 1) < 0.05);
    assert_true(fabs(r.report.coded.training - here.report.coded.training) < 1);
    free(here.bytes);
    free(r.bytes);
}

TEST_GROUP(set_up, tear_down);
