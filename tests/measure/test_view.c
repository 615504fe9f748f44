/* SPDX-License-Identifier: MIT
 *
 * Watching a file: cameras are converted from metres to integers and back,
 * pictures of the vectors are drawn through trainer/film/view; the camera
 * path and the montage of pictures are tested, too.
 */
#include "change.h"
#include "evaluate.h"
#include "error.h"
#include "file.h"
#include "montage.h"
#include "orbit.h"
#include "picture.h"
#include "view.h"
#include "testing.h"

#include <unistd.h>

static const char vector[] = "vectors/good/motion.saga";

static double uniform(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return (*state >> 8) / 16777216.0 * 2.0 - 1.0;
}

/* Returns a turned camera somewhere around a cube, from a unit quaternion. */
static saga_source_view random_view(const saga_metric *m, uint32_t *seed)
{
    saga_source_view s = { .name = "random", .width = 640, .height = 360 };
    double q[4], n = 0.0, centre[3];

    for (int i = 0; i < 4; i++)
        q[i] = uniform(seed);
    for (int i = 0; i < 4; i++)
        n += q[i] * q[i];
    for (int i = 0; i < 9; i++) {
        const int a = i / 3, b = i % 3, c = 3 - a - b;
        const double sign = (b - a + 3) % 3 == 1 ? -1.0 : 1.0;

        s.rotation[i] =
            a == b ? 2.0 * (q[0] * q[0] + q[a + 1] * q[a + 1]) / n - 1.0
                   : 2.0 * (q[a + 1] * q[b + 1] + sign * q[0] * q[c + 1]) / n;
    }
    for (int i = 0; i < 3; i++)
        centre[i] = m->centre[i] + 2.0 * saga_metric_width(m) * uniform(seed);
    for (int i = 0; i < 3; i++)
        s.translation[i] = -(s.rotation[3 * i] * centre[0] +
                             s.rotation[3 * i + 1] * centre[1] +
                             s.rotation[3 * i + 2] * centre[2]);
    s.fx = 500.0 + 100.0 * uniform(seed);
    s.fy = 500.0 + 100.0 * uniform(seed);
    s.cx = 320.0 + 50.0 * uniform(seed);
    s.cy = 180.0 + 50.0 * uniform(seed);
    return s;
}

/* --- Cameras ------------------------------------------------------------- */

static const saga_metric somewhere = { 3e-7, { 12.5, -3.25, 1000.0 } };

TEST(camera_should_come_back_from_integers)
{
    uint32_t seed = 1;

    for (int k = 0; k < 500; k++) {
        const saga_source_view s = random_view(&somewhere, &seed);
        saga_source_view back = { .name = "" };
        saga_error error = { "" };
        saga_camera c = { .near_plane = 0 };
        double p[3], q[3];

        assert_true(
            saga_camera_of_source_view(&c, &somewhere, &s, 0.01, &error));
        assert_int_equal(c.near_plane, 33333);
        saga_source_view_of_camera(&back, &somewhere, &c);
        saga_source_view_centre(p, &s);
        saga_source_view_centre(q, &back);
        for (int i = 0; i < 3; i++)
            assert_true(fabs(p[i] - q[i]) < 1e-5);
        for (int i = 0; i < 9; i++)
            assert_true(fabs(s.rotation[i] - back.rotation[i]) < 1e-9);
        assert_true(fabs(s.fx - back.fx) <= 1.0 / 131072.0);
        assert_true(fabs(s.cy - back.cy) <= 1.0 / 131072.0);
    }
}

/* The conversion must give rows of length 1 and keep to the limit of saga.h for
 * the sum of a row, also where this sum is largest and if the rows of the
 * capture are too long. */
TEST(rotation_should_keep_to_its_limit)
{
    const saga_metric here = { 3e-7, { 0.0, 0.0, 0.0 } };
    uint32_t seed = 2;

    for (int k = 0; k < 500; k++) {
        saga_source_view s = random_view(&here, &seed);
        saga_error error = { "" };
        saga_camera c = { .near_plane = 0 };

        for (int i = 0; i < 3 && k == 0; i++)
            s.rotation[i] = 1.0;
        for (int i = 0; i < 9; i++)
            s.rotation[i] *= 1.0 + 1e-3 * k;
        assert_true(saga_camera_of_source_view(&c, &here, &s, 0.01, &error));
        for (int row = 0; row < 3; row++) {
            const int32_t *const r = c.rotation_q30 + 3 * row;
            const int64_t sum = (int64_t)abs(r[0]) + abs(r[1]) + abs(r[2]);

            assert_true((double)sum <= 1.7321 * 1073741824.0);
            assert_true(fabs(sqrt((double)r[0] * r[0] + (double)r[1] * r[1] +
                                  (double)r[2] * r[2]) -
                             1073741824.0) < 2.0);
        }
    }
}

static void refused(const saga_source_view *s, double near_metres,
                    const char *says)
{
    saga_error error = { "" };
    saga_camera c = { .near_plane = 0 };

    assert_false(
        saga_camera_of_source_view(&c, &somewhere, s, near_metres, &error));
    if (!strstr(error.message, says) || !strstr(error.message, s->name))
        fail_msg("no '%s' in: %s", says, error.message);
}

TEST(camera_should_be_refused_with_its_value)
{
    uint32_t seed = 3;
    const saga_source_view good = random_view(&somewhere, &seed);
    saga_source_view s = good;

    s.fx = 0.0;
    refused(&s, 0.01, "focal length, 0");
    s.fx = 32768.0;
    refused(&s, 0.01, "focal length, 32768");
    s = good;
    s.cx = 1e5;
    refused(&s, 0.01, "principal point, 100000");
    s = good;
    s.translation[1] = 1e6;
    refused(&s, 0.01, "position");
    s.translation[1] = (double)NAN;
    refused(&s, 0.01, "nan");
    s = good;
    s.rotation[0] = s.rotation[1] = s.rotation[2] = 0.0;
    refused(&s, 0.01, "rotation");
    s = good;
    s.width = 16385;
    refused(&s, 0.01, "width, 16385");
    refused(&good, (double)INFINITY, "near plane");
}

TEST(resized_camera_should_see_the_same)
{
    saga_camera c = { .focal_q16 = { 100 << 16, 90 << 16 },
                      .principal_q16 = { 84 << 16, 60 << 16 },
                      .width = 160,
                      .height = 120 };

    saga_camera_resize(&c, 320, 480);
    assert_int_equal(c.width, 320);
    assert_int_equal(c.height, 480);
    assert_int_equal(c.focal_q16[0], 200 << 16);
    assert_int_equal(c.focal_q16[1], 180 << 16);
    assert_int_equal(c.principal_q16[0], 168 << 16);
    assert_int_equal(c.principal_q16[1], 240 << 16);
}

/* --- A file -------------------------------------------------------------- */

typedef struct {
    saga_bytes bytes;
    saga_film film;
    saga_error error;
} opened;

static void open_file(opened *o, const char *name, int n_threads)
{
    *o = (opened){ .film = { .segment = -1 } };
    assert_true(saga_read_file(&o->bytes, name, &o->error));
    if (!saga_film_open(&o->film, name, o->bytes.data, o->bytes.nbytes,
                        n_threads, &o->error))
        fail_msg("%s", o->error.message);
}

static void open_vector(opened *o, int n_threads)
{
    open_file(o, vector, n_threads);
}

static void close_vector(opened *o)
{
    saga_film_close(&o->film);
    saga_bytes_free(&o->bytes);
}

/* Returns the CRC of the picture of frame 0 in camera 0, which is the last
 * column of the line for segment 0 of the vector at time 0. */
static uint32_t manifest_crc(void)
{
    FILE *const f = must(fopen("vectors/MANIFEST", "r"));
    char line[512];
    uint32_t crc = 0;
    bool found = false;

    while (!found && fgets(line, sizeof line, f))
        found = sscanf(line,
                       "good/motion.saga 0 %*s %*s %*s %*s 0 0 %*s %*s "
                       "%" SCNx32,
                       &crc) == 1;
    fclose(f);
    assert_true(found);
    return crc;
}

TEST(picture_should_be_the_vectors_on_any_threads)
{
    const uint32_t want = manifest_crc();

    for (int threads = 1; threads <= 5; threads += 2) {
        saga_camera c;
        uint32_t number;
        FREED uint8_t *rgb;
        size_t n;
        FREED_BY(close_vector) opened o;

        open_vector(&o, threads);
        assert_true(saga_film_rig(&o.film, 0, &c, &number, &o.error));
        n = 3 * (size_t)c.width * c.height;
        rgb = must(malloc(n));
        assert_true(saga_film_draw(&o.film, &c, 0, 1, rgb, &o.error));
        assert_true(saga_crc32c(0, rgb, n) == want);
        assert_int_equal(o.film.times.n_segments, 1);
        assert_int_equal(o.film.times.n_views, 1);
        assert_true(saga_film_draw(&o.film, &c, 15, 2, rgb, &o.error));
        assert_int_equal(o.film.times.n_segments, 1);
    }
}

TEST(what_a_file_lacks_should_be_told)
{
    uint8_t rgb[3];
    saga_camera c;
    uint32_t number;
    opened o;

    open_vector(&o, 1);
    assert_false(saga_film_rig(&o.film, 3, &c, &number, &o.error));
    assert_non_null(strstr(o.error.message, "no camera 3; it has 3 cameras"));
    o.error.message[0] = '\0';
    assert_false(saga_film_draw(&o.film, &c, 9999, 1, rgb, &o.error));
    assert_non_null(strstr(o.error.message, "no frame 9999 among its"));
    /* If the file lacks its last byte, it must open, but its segment must be
     * refused. */
    close_vector(&o);
    open_vector(&o, 1);
    o.film.nbytes -= 1;
    assert_true(saga_film_rig(&o.film, 0, &c, &number, &o.error));
    assert_false(saga_film_draw(&o.film, &c, 0, 1, rgb, &o.error));
    assert_non_null(strstr(o.error.message, "segment 0 is refused"));
    close_vector(&o);
}

TEST(damaged_file_should_not_open)
{
    FREED_BY(close_vector) opened o;

    open_vector(&o, 1);
    saga_film_close(&o.film);
    o.bytes.data[20] ^= 1;
    assert_false(saga_film_open(&o.film, vector, o.bytes.data, o.bytes.nbytes,
                                1, &o.error));
    assert_non_null(strstr(o.error.message, vector));
    assert_null(o.film.work);
}

TEST(hurried_film_should_say_how_to_wait)
{
    FREED_BY(close_vector) opened o;

    open_vector(&o, 1);
    saga_film_close(&o.film);
    assert_false(
        saga_film_open_within(&o.film, vector, &o.bytes, 1e-9, &o.error));
    assert_non_null(strstr(o.error.message, "more than 1e-09 s"));
    assert_non_null(strstr(o.error.message, "allow more with --seconds 6e-09"));
    assert_null(o.film.work);
    o.error.message[0] = 0;
    assert_true(
        saga_film_open_within(&o.film, vector, &o.bytes, 600, &o.error));
}

/* --- The path ------------------------------------------------------------ */

/* Every camera of the orbit must look at the focus, have the up direction of
 * the path, be as far away as the cameras of the rig, and no further to the
 * side. */
TEST(orbit_should_stay_where_the_rig_was)
{
    saga_orbit p;
    FREED_BY(close_vector) opened o;

    open_vector(&o, 1);
    assert_true(saga_orbit_of(&p, &o.film, &o.error));
    assert_false(p.closed);
    for (int k = 0; k < 16; k++) {
        saga_source_view s = { .name = "" };
        saga_camera c;
        double at[3], centre[3], along = 0.0, level = 0.0;

        assert_true(
            saga_orbit_camera(&c, &p, &o.film.metric, k / 16.0, &o.error));
        saga_source_view_of_camera(&s, &o.film.metric, &c);
        saga_view_transform(&s, p.focus, at);
        assert_true(fabs(at[0]) < 1e-4 && fabs(at[1]) < 1e-4);
        assert_true(fabs(at[2] - hypot(p.radius, p.height)) < 1e-4);
        saga_source_view_centre(centre, &s);
        for (int i = 0; i < 3; i++) {
            along += (centre[i] - p.focus[i]) * p.side[i];
            level += s.rotation[i] * p.up[i];
        }
        assert_true(fabs(along) <=
                    p.radius * sin(fmin(p.half + fabs(p.middle), 1.5707963)) +
                        1e-3);
        assert_true(fabs(level) < 1e-6);
    }
}

static saga_camera rig_lens(const opened *o)
{
    saga_error error = { "" };
    saga_camera c;
    uint32_t number;

    assert_true(saga_film_rig(&o->film, 0, &c, &number, &error));
    return c;
}

enum { X, Y, Z, MINUS_X };

static double along(const double a[3], int axis)
{
    return axis == MINUS_X ? -a[X] : a[axis];
}

static void set_axis(int16_t to[3], int axis)
{
    to[axis % 3] = axis == MINUS_X ? -16384 : 16384;
}

/* A volume of 20 degrees to the sides and 2 to 2.5 units of the capture away,
 * for an orbit of a full circle around (0, 0, 0), lower and nearer. Its axes
 * are those of the orbit or others, as another program may choose them. Where a
 * camera is follows from the axes of the row alone. */
TEST(orbit_should_stay_in_the_viewing_volume)
{
    static const double degree = 3.14159265358979323846 / 180;
    static const saga_metric metric = { 1.0 / (1 << 22), { 0, 0, 0 } };
    static const struct {
        double pivot[3];
        int up, front, side; /* side = up x front */
        int lowest, highest; /* degrees */
        double elevation;    /* that of the path */
    } rows[] = {
        { { 0, 0, 0 }, Z, Y, MINUS_X, 10, 15, 10 },
        { { 0.5, -0.25, 1 }, Z, Y, MINUS_X, 10, 15, 10 },
        { { 0, 0, -1 }, Y, Z, X, -60, -30, -30 },
        { { 0, 0, 0 }, Z, Y, MINUS_X, 90, 90, 0.499 * 180 },
    };
    FREED_BY(close_vector) opened o;

    open_vector(&o, 1);
    for (size_t r = 0; r < sizeof rows / sizeof *rows; r++) {
        saga_orbit p = { .up = { 0, 0, 1 },
                         .ahead = { 1, 0, 0 },
                         .side = { 0, 1, 0 },
                         .lens = rig_lens(&o),
                         .radius = 1,
                         .half = 180 * degree,
                         .closed = true };
        saga_volume v = {
            .distance_min = 2 << 22,
            .distance_max = 5 << 21,
            .azimuth = (uint16_t)(32768 * 20 / 180),
            .elevation_min = (int16_t)(32768 * rows[r].lowest / 180),
            .elevation_max = (int16_t)(32768 * rows[r].highest / 180)
        };
        double most = 0;

        set_axis(v.up, rows[r].up);
        set_axis(v.front, rows[r].front);
        for (int i = 0; i < 3; i++)
            v.pivot[i] = (int32_t)(rows[r].pivot[i] * (1 << 22));
        saga_orbit_keep_inside(&p, &v, &metric);
        for (int k = 0; k < 16; k++) {
            saga_source_view s = { .name = "" };
            saga_error error = { "" };
            double to[3], d;
            saga_camera c;

            assert_true(saga_orbit_camera(&c, &p, &metric, k / 16.0, &error));
            saga_source_view_of_camera(&s, &metric, &c);
            saga_source_view_centre(to, &s);
            for (int i = 0; i < 3; i++)
                to[i] -= rows[r].pivot[i];
            d = sqrt(to[0] * to[0] + to[1] * to[1] + to[2] * to[2]);
            assert_true(fabs(d - 2) < 0.001);
            assert_true(fabs(asin(along(to, rows[r].up) / d) -
                             rows[r].elevation * degree) < 0.001);
            most = fmax(most, fabs(atan2(along(to, rows[r].side),
                                         along(to, rows[r].front))));
            /* It looks at the pivot. */
            for (int i = 0; i < 3; i++)
                assert_true(fabs(s.rotation[6 + i] + to[i] / d) < 0.001);
        }
        assert_true(fabs(most - 20 * degree) < 0.001);
    }
}

/* --- Evaluation ---------------------------------------------------------- */

/* Returns a capture with the rig's cameras and without pictures. */
static saga_capture rig_capture(const opened *o)
{
    const saga_info *const i = &o->film.info;
    saga_capture c = { .format = "test",
                       .n_views = (int)i->n_cameras,
                       .n_frames = (int)i->n_frames,
                       .scale = 1,
                       .fps = (double)i->fps_num / i->fps_den };

    c.views = must(calloc(i->n_cameras, sizeof *c.views));
    for (uint32_t k = 0; k < i->n_cameras; k++) {
        saga_error error = { "" };
        saga_camera camera;
        uint32_t number;

        assert_true(saga_film_rig(&o->film, k, &camera, &number, &error));
        saga_source_view_of_camera(&c.views[k], &o->film.metric, &camera);
        snprintf(c.views[k].name, sizeof c.views[k].name, "cam%02" PRIu32, k);
    }
    return c;
}

static void mismatch(const opened *o, const saga_capture *c, const char *says)
{
    saga_error error = { "" };
    saga_eval e;

    assert_false(saga_eval_match(&e, &o->film, c, -1, &error));
    assert_null(e.view);
    if (!strstr(error.message, says))
        fail_msg("no '%s' in: %s", says, error.message);
}

/* 43,000 frames times 100,000 pictures is more than 2^32, which must not
 * overflow. */
TEST(orbit_should_go_through_the_longest_film)
{
    static const uint32_t frames[] = { 24, 43000, 1 << 24, UINT32_MAX };

    for (size_t k = 0; k < sizeof frames / sizeof *frames; k++)
        for (int i = 0; i < 100000; i += 9999) {
            const double wanted = frames[k] * (i / 100000.0);
            uint32_t num, den;

            saga_orbit_time(&num, &den, frames[k], i, 100000);
            assert_true(den > 0);
            assert_true(fabs((double)num / den - wanted) <= 1.0 / den);
            assert_true((double)num / den < frames[k]);
        }
}

TEST(capture_should_be_refused_where_it_differs)
{
    char says[64];
    FREED_BY(saga_capture_free) saga_capture c;
    saga_source_view *v;
    saga_eval e;
    FREED_BY(close_vector) opened o;

    open_vector(&o, 1);
    c = rig_capture(&o);
    v = &c.views[1];
    c.n_frames--;
    snprintf(says, sizeof says, "%d frames, the capture gives %d",
             c.n_frames + 1, c.n_frames);
    mismatch(&o, &c, says);
    c.n_frames++;
    c.fps = 25.0;
    mismatch(&o, &c, "30 frames per second, the capture 25");
    c.fps = 30.0;
    v->translation[0] += 1e-3 * saga_metric_width(&o.film.metric);
    mismatch(&o, &c, "cam01 is not one of its cameras");
    v->held_out = true;
    assert_true(saga_eval_match(&e, &o.film, &c, -1, &o.error));
    assert_int_equal(e.view[0].rig, 0);
    assert_int_equal(e.view[1].rig, -1);
    assert_int_equal(e.view[2].rig, 2);
    assert_int_equal(e.n_training, 2);
    assert_int_equal(e.n_held_out, 1);
    saga_eval_free(&e);
    v->held_out = false;
    v->translation[0] -= 1e-3 * saga_metric_width(&o.film.metric);
    v->fx *= 1.1;
    mismatch(&o, &c, "focal length");
}

/* A view with the name of a camera of the rig is that camera if it differs from
 * it by as much as refinement changes one, 0.02 of the cube, and no other. */
TEST(view_should_not_be_taken_for_a_camera_far_away)
{
    FREED_BY(saga_capture_free) saga_capture c;
    FREED_BY(close_vector) opened o;
    saga_source_view *v;
    saga_eval e;
    double width;

    open_file(&o, "vectors/good/names.saga", 1);
    c = rig_capture(&o);
    v = &c.views[0];
    width = saga_metric_width(&o.film.metric);
    v->held_out = true;
    strcpy(v->name, "c\xc3\xa1m 0");
    v->translation[2] += 0.019 * width;
    assert_true(saga_eval_match(&e, &o.film, &c, -1, &o.error));
    assert_int_equal(e.view[0].rig, 0);
    saga_eval_free(&e);
    v->translation[2] += 0.002 * width;
    assert_true(saga_eval_match(&e, &o.film, &c, -1, &o.error));
    assert_int_equal(e.view[0].rig, -1);
    saga_eval_free(&e);
}

/* Fills a capture with each frame of each view as decoded from the file, except
 * that each view's first frame has the grey `level`. */
static void fill_capture(saga_capture *c, opened *o, const saga_eval *e,
                         int level)
{
    for (int i = 0; i < c->n_views; i++) {
        const size_t n = saga_view_frame_nbytes(&c->views[i]);

        c->views[i].rgb = must(malloc(n * (size_t)c->n_frames));
        for (int k = 0; k < c->n_frames; k++)
            assert_true(
                saga_film_draw(&o->film, &e->view[i].camera, (uint32_t)k, 1,
                               c->views[i].rgb + n * (size_t)k, &o->error));
        memset(c->views[i].rgb, level, n);
    }
}

typedef struct {
    double median_psnr, median_mse;
    saga_change change;
} wanted;

static double told(const saga_score *score, const char *key)
{
    return saga_score_told(score, saga_metric_called(key));
}

static void expect_change(const saga_score *got, const saga_change *want)
{
    assert_true(told(got, "changing_pixels") == (double)want->n_changing);
    assert_true(fabs(told(got, "changing_psnr") -
                     10 * log10(65025.0 * 3.0 * (double)want->n_changing /
                                (double)want->error)) < 1e-9);
}

/* Computes the expected scores of a view frame by frame. The pictures drawn
 * from the file are wrong only in frame 0, which is grey in the capture. */
static void expect_score(wanted *want, opened *o, const saga_capture *c,
                         const saga_eval_view *v, int view)
{
    const size_t n = saga_view_frame_nbytes(&c->views[view]);
    const int f = c->n_frames;
    FREED uint8_t *const median = must(malloc(n));
    FREED uint8_t *const rgb = must(malloc(n));
    const uint8_t *frame[64];

    for (int k = 0; k < f; k++)
        frame[k] = saga_capture_frame(c, view, k);
    saga_median_picture(median, frame, f, n, 1);
    assert_true(saga_film_draw(&o->film, &v->camera, 0, 1, rgb, &o->error));
    *want = (wanted){ .median_mse = 0.0 };
    for (int k = 0; k < f; k++) {
        const double mse = saga_mse(frame[k], median, n);

        saga_change_add(&want->change, median, frame[k], k ? frame[k] : rgb,
                        n / 3);
        want->median_mse += mse / f;
        want->median_psnr += saga_psnr(mse) / f;
    }
}

TEST(score_should_tell_medians_and_changes)
{
    const saga_eval_options options = { .pictures = NULL };
    wanted want[3], set = { .median_mse = 0.0 };
    FREED_BY(saga_capture_free) saga_capture c;
    FREED_BY(saga_eval_free) saga_eval e;
    FREED_BY(close_vector) opened o;
    const saga_eval_maker maker = { .name = "vector",
                                    .n_threads = 1,
                                    .draw = saga_eval_draw_film,
                                    .state = &o.film };

    open_vector(&o, 2);
    c = rig_capture(&o);
    c.views[2].held_out = true;
    assert_true(saga_eval_match(&e, &o.film, &c, -1, &o.error));
    fill_capture(&c, &o, &e, 180);
    assert_true(saga_eval_run(&e, &maker, &c, &options, &o.error));
    for (int i = 0; i < 3; i++) {
        const saga_score *const got = &e.view[i].score;

        expect_score(&want[i], &o, &c, &e.view[i], i);
        expect_change(got, &want[i].change);
        assert_true(want[i].change.n_changing > 0);
        assert_true(fabs(told(got, "changing_share") -
                         (double)want[i].change.n_changing /
                             (double)want[i].change.n_pixels) < 1e-12);
        assert_true(fabs(told(got, "median_psnr_of_mean_mse") -
                         10 * log10(65025.0 / want[i].median_mse)) < 1e-9);
        assert_true(fabs(told(got, "median_psnr") - want[i].median_psnr) <
                    1e-9);
        if (i < 2) {
            set.change.n_changing += want[i].change.n_changing;
            set.change.error += want[i].change.error;
            set.median_psnr += want[i].median_psnr / 2;
        }
    }
    expect_change(&e.training, &set.change);
    assert_true(fabs(told(&e.training, "median_psnr") - set.median_psnr) <
                1e-9);
    expect_change(&e.held_out, &want[2].change);
}

/* All samples are 100, except frame 1 of the truth, which is 110. Frame 0 of
 * view 0 is masked, so that n - 1 frames count, whose median is 100. The best
 * factor is 1 + 0.1 / (n - 1), which leaves an error of d = 10 / (n - 1) in all
 * frames except frame 1, where it leaves 10 - d. */
TEST(frames_that_a_mask_empties_should_be_in_no_mean)
{
    const saga_eval_options options = { .pictures = NULL };
    saga_capture c, made;
    FREED_BY(saga_eval_free) saga_eval e;
    FREED_BY(close_vector) opened o;
    const saga_eval_maker maker = { .name = "made",
                                    .n_threads = 1,
                                    .draw = saga_eval_draw_pictures,
                                    .state = &made };
    double n, d;

    open_vector(&o, 2);
    c = rig_capture(&o);
    made = rig_capture(&o);
    assert_true(saga_eval_match(&e, &o.film, &c, -1, &o.error));
    for (int i = 0; i < c.n_views; i++) {
        const size_t size = saga_view_frame_nbytes(&c.views[i]);
        const size_t all = size * (size_t)c.n_frames;

        c.views[i].rgb = must(malloc(all));
        made.views[i].rgb = must(malloc(all));
        memset(c.views[i].rgb, 100, all);
        memset(made.views[i].rgb, 100, all);
        memset(c.views[i].rgb + size, 110, size);
        if (i == 0) {
            c.views[i].mask = must(malloc(all / 3));
            memset(c.views[i].mask, 1, all / 3);
            memset(c.views[i].mask, 0, size / 3);
        }
    }
    assert_true(saga_eval_run(&e, &maker, &c, &options, &o.error));
    n = c.n_frames - 1;
    d = 10 / n;
    assert_true(fabs(told(&e.view[0].score, "median_psnr_of_mean_mse") -
                     10 * log10(65025 / (100 / n))) < 1e-9);
    assert_true(
        fabs(told(&e.view[0].score, "psnr_exposed") -
             10 * log10(65025 * n / (d * d * (n - 1) + (10 - d) * (10 - d)))) <
        1e-6);
    saga_capture_free(&c);
    saga_capture_free(&made);
}

/* The pictures of another codec must be scored in the same way. One frame of
 * view 1 is wrong by 10 in all samples, so that the view's squared error is 100
 * divided by the number of frames; all others are right. */
TEST(pictures_of_another_codec_should_be_judged_alike)
{
    const saga_eval_options options = { .pictures = NULL };
    saga_capture c, made;
    saga_eval e;
    FREED_BY(close_vector) opened o;
    const saga_eval_maker maker = { .name = "made",
                                    .n_threads = 1,
                                    .draw = saga_eval_draw_pictures,
                                    .state = &made };

    open_vector(&o, 2);
    c = rig_capture(&o);
    assert_true(saga_eval_match(&e, &o.film, &c, -1, &o.error));
    fill_capture(&c, &o, &e, 180);
    saga_eval_free(&e);
    made = rig_capture(&o);
    for (int i = 0; i < c.n_views; i++) {
        const size_t n = saga_view_frame_nbytes(&c.views[i]);

        made.views[i].rgb = copy_of(c.views[i].rgb, n * (size_t)c.n_frames);
        if (i == 1)
            memset(made.views[i].rgb, 190, n);
    }
    assert_true(saga_eval_match_pictures(&e, "made", &made, &c, &o.error));
    assert_true(saga_eval_run(&e, &maker, &c, &options, &o.error));
    for (int i = 0; i < c.n_views; i++)
        assert_true(fabs(told(&e.view[i].score, "mse") -
                         (i == 1) * 100.0 / c.n_frames) < 1e-9);
    saga_eval_free(&e);
    strcpy(made.views[0].name, "other");
    assert_false(saga_eval_match_pictures(&e, "made", &made, &c, &o.error));
    assert_non_null(strstr(o.error.message, "has other of"));
    made.n_frames--;
    assert_false(saga_eval_match_pictures(&e, "made", &made, &c, &o.error));
    saga_capture_free(&made);
    saga_capture_free(&c);
}

/* --- Pictures side by side ----------------------------------------------- */

TEST(difference_should_be_clipped)
{
    const uint8_t a[4] = { 10, 200, 0, 7 }, b[4] = { 12, 100, 255, 7 };
    uint8_t d[4];

    saga_difference(d, a, b, 4, 4);
    assert_int_equal(d[0], 8);
    assert_int_equal(d[1], 255);
    assert_int_equal(d[2], 255);
    assert_int_equal(d[3], 0);
}

TEST(montage_should_place_pictures_on_grey)
{
    static const uint8_t one[3 * 2 * 3] = { 1, 2, 3 }, two[3] = { 9, 8, 7 };
    const saga_still stills[3] = { { one, 2, 3 },
                                   { two, 1, 1 },
                                   { two, 1, 1 } };
    enum { W = 2 + SAGA_MONTAGE_GAP + 2, H = 3 + SAGA_MONTAGE_GAP + 3 };
    char path[] = "/tmp/saga-montage-XXXXXX";
    uint8_t rgb[3 * W * H];
    const int fd = mkstemp(path);

    assert_true(fd >= 0);
    close(fd);
    assert_done(saga_montage_write(path, stills, 3, 2, &error));
    assert_done(saga_picture_read(
        path, &(saga_picture_wish){ .width = W, .height = H }, rgb, &error));
    assert_memory_equal(rgb, one, 6);
    assert_int_equal(rgb[3 * 2], 128);
    assert_memory_equal(rgb + 3 * (2 + SAGA_MONTAGE_GAP), two, 3);
    assert_memory_equal(rgb + 3 * W * (3 + SAGA_MONTAGE_GAP), two, 3);
    assert_int_equal(rgb[3 * W * H - 1], 128);
    remove(path);
}
