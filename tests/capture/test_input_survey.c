/* SPDX-License-Identifier: MIT
 *
 * The survey of a capture. Faults of known size are planted in the built-in
 * room; each must be found with its size, and nothing must be found in the
 * unchanged room.
 */
#include "order.h"
#include "pose.h"
#include "survey.h"
#include "synth_fixture.h"
#include "testing.h"

enum { W = 96, H = 54, N_VIEWS = 8, N_FRAMES = 30 };

/* The room, which is made once, and a copy for each test. */
static void *room;

static int open_room(void **state __attribute__((unused)))
{
    saga_synth_options s = synth_options(W, H, N_VIEWS, N_FRAMES, 800);

    s.samples = 1;
    return synth_enter(&room, &s);
}

static int close_room(void **state __attribute__((unused)))
{
    return synth_leave(&room);
}

TEST_GROUP(open_room, close_room);

static int copy_room(void **state)
{
    saga_capture *const c = *state = copy_of(room, sizeof *c);

    c->views = copy_of(c->views, N_VIEWS * sizeof *c->views);
    for (int v = 0; v < N_VIEWS; v++)
        c->views[v].rgb = copy_of(c->views[v].rgb, 3 * W * H * N_FRAMES);
    return 0;
}

static int free_copy(void **state)
{
    saga_capture *const c = *state;

    for (int v = 0; v < N_VIEWS; v++)
        free(c->views[v].rgb);
    free(c->views);
    free(c);
    return 0;
}

static saga_survey survey(const saga_capture *c)
{
    saga_survey s;

    assert_done(saga_survey_make(&s, c, &error));
    return s;
}

/* Returns the angle in degrees between two cameras as seen from a place. */
static double angle_from(const double x[3], const saga_source_view *a,
                         const saga_source_view *b)
{
    double p[3], q[3], pq = 0, pp = 0, qq = 0;

    saga_pose_centre(a->rotation, a->translation, p);
    saga_pose_centre(b->rotation, b->translation, q);
    for (int i = 0; i < 3; i++) {
        pq += (p[i] - x[i]) * (q[i] - x[i]);
        pp += (p[i] - x[i]) * (p[i] - x[i]);
        qq += (q[i] - x[i]) * (q[i] - x[i]);
    }
    return acos(pq / sqrt(pp * qq)) * 180 / 3.14159265358979;
}

TEST_WITH(room_should_have_no_warnings, copy_room, free_copy)
{
    const saga_capture *const c = *state;
    FREED_BY(saga_survey_free) saga_survey s = survey(c);
    double middle[3], x[800];

    assert_string_equal(s.notes, "");
    assert_true(s.free_views);
    for (int k = 0; k < 3; k++) {
        for (size_t i = 0; i < c->n_points; i++)
            x[i] = c->points[i].position[k];
        qsort(x, c->n_points, sizeof *x, saga_by_value);
        middle[k] = x[c->n_points / 2];
    }
    for (int v = 0; v < N_VIEWS; v++) {
        const saga_survey_view *const one = &s.views[v];

        assert_in_range(one->nearest, 0, N_VIEWS - 1);
        assert_true(fabs(one->angle - angle_from(middle, &c->views[v],
                                                 &c->views[one->nearest])) <
                    1e-6);
        assert_true(one->overlap > 0.8 && one->overlap <= 1);
        assert_true(fabs(one->stops) < 0.05 && one->colour < 6);
        assert_false(fabs(one->late.frames) > one->late.tolerance);
    }
}

/* All frames flicker equally in all cameras, as they do with flickering lamps.
 * The motion in thirty frames of the room, filmed from eight sides, is too
 * little to estimate delays otherwise. */
static void flicker(const saga_capture *c)
{
    uint32_t x = 1;

    for (int k = 0; k < N_FRAMES; k++) {
        x = x * 1664525u + 1013904223u;
        for (int v = 0; v < N_VIEWS; v++) {
            const size_t n = saga_view_frame_nbytes(&c->views[v]);
            uint8_t *const rgb = c->views[v].rgb + (size_t)k * n;

            for (size_t i = 0; i < n; i++)
                rgb[i] = (uint8_t)(rgb[i] * (192 + (x >> 26)) / 256);
        }
    }
}

TEST_WITH(late_camera_should_be_found, copy_room, free_copy)
{
    saga_capture *const c = *state;
    saga_source_view *const v = &c->views[3];
    const size_t n = saga_view_frame_nbytes(v);
    FREED_BY(saga_survey_free) saga_survey s;

    flicker(c);
    memmove(v->rgb + 3 * n, v->rgb, (N_FRAMES - 3) * n);
    s = survey(c);
    for (int i = 0; i < N_VIEWS; i++)
        assert_true(fabs(s.views[i].late.frames - (i == 3 ? 3 : 0)) <=
                    s.views[i].late.tolerance);
    assert_true(says(&s, "cam03 seems to run 3.0 frames (+-0."));
    assert_true(says(&s, ") behind the others: give --late cam03=3, or "
                         "hold it"));
}

TEST_WITH(dark_camera_should_be_found, copy_room, free_copy)
{
    saga_capture *const c = *state;
    saga_source_view *const v = &c->views[5];
    FREED_BY(saga_survey_free) saga_survey s;

    /* The camera gets half of the light. */
    for (size_t i = 0; i < saga_view_frame_nbytes(v) * N_FRAMES; i++)
        v->rgb[i] = (uint8_t)(v->rgb[i] * pow(0.5, 1 / 2.2) + 0.5);
    s = survey(c);
    for (int i = 0; i < N_VIEWS; i++)
        assert_true(fabs(s.views[i].stops + (i == 5)) < 0.06);
    assert_true(s.views[5].colour < 6);
    assert_true(says(&s, "cam05 is ") && says(&s, " stops darker"));
}

/* Ways in which the pictures of a camera are dead, or show something else. */
static void make_black(saga_capture *c, saga_source_view *v, size_t n)
{
    (void)c;
    memset(v->rgb, 3, n * N_FRAMES);
}

static void make_white(saga_capture *c, saga_source_view *v, size_t n)
{
    (void)c;
    memset(v->rgb, 250, n * N_FRAMES);
}

static void make_noise(saga_capture *c, saga_source_view *v, size_t n)
{
    uint32_t x = 1;

    (void)c;
    for (size_t i = 0; i < n * N_FRAMES; i++)
        v->rgb[i] = (uint8_t)((x = x * 1664525u + 1013904223u) >> 24);
}

static void exchange_channels(saga_capture *c, saga_source_view *v, size_t n)
{
    (void)c;
    for (size_t i = 0; i < n * N_FRAMES; i += 3) {
        const uint8_t red = v->rgb[i];

        v->rgb[i] = v->rgb[i + 2];
        v->rgb[i + 2] = red;
    }
}

static void make_grey(saga_capture *c, saga_source_view *v, size_t n)
{
    (void)c;
    for (size_t i = 0; i < n * N_FRAMES; i += 3)
        memset(v->rgb + i, v->rgb[i + 1], 3);
}

static void freeze(saga_capture *c, saga_source_view *v, size_t n)
{
    flicker(c);
    for (size_t k = 3; k < N_FRAMES; k++)
        memcpy(v->rgb + k * n, v->rgb + 2 * n, n);
}

/* Averages boxes of 7 x 7 pixels. */
static void defocus(saga_capture *c, saga_source_view *v, size_t n)
{
    FREED uint8_t *const from = copy_of(v->rgb, n * N_FRAMES);

    (void)c;
    for (size_t i = 0; i < n * N_FRAMES; i++) {
        const int x = (int)(i % n / 3 % W), y = (int)(i % n / 3 / W);
        int sum = 0, count = 0;

        for (int b = y - 3; b <= y + 3; b++)
            for (int a = x - 3; a <= x + 3; a++)
                if (a >= 0 && b >= 0 && a < W && b < H) {
                    sum += from[i / n * n + (size_t)(b * W + a) * 3 + i % 3];
                    count++;
                }
        v->rgb[i] = (uint8_t)(sum / count);
    }
}

/* Each fault is planted in cam04; it alone must be named, with the reason. */
TEST_WITH(dead_and_foreign_cameras_should_be_named, copy_room, free_copy)
{
    static const struct {
        void (*plant)(saga_capture *c, saga_source_view *v, size_t n);
        const char *note;
    } faults[] = {
        { make_black, "Nothing is seen: cam04 is black (in 3 of 3 pictures" },
        { make_white, "Nothing is seen: cam04 is white (in 3 of 3 pictures" },
        { make_noise, "Noise instead of pictures: cam04. " },
        { exchange_channels, "Red and blue are exchanged: cam04 (" },
        { make_grey, "at the same places: cam04 differs by " },
        { freeze, "Frozen, or nothing that moves is in view: cam04 stands" },
        { defocus, "Out of focus: cam04 has " }
    };
    saga_capture *const c = *state;
    saga_source_view *const v = &c->views[4];
    const size_t n = saga_view_frame_nbytes(v);
    uint8_t *right[N_VIEWS];

    /* Few frames suffice, and are too few to look for delays. */
    c->n_frames = 8;
    for (int i = 0; i < N_VIEWS; i++)
        right[i] = copy_of(c->views[i].rgb, n * N_FRAMES);
    for (size_t i = 0; i < sizeof faults / sizeof *faults; i++) {
        saga_survey s;

        faults[i].plant(c, v, n);
        s = survey(c);
        print_message("%s", s.notes);
        assert_true(says(&s, faults[i].note));
        assert_false(says(&s, "cam03") || says(&s, "cam05"));
        saga_survey_free(&s);
        for (int k = 0; k < N_VIEWS; k++)
            memcpy(c->views[k].rgb, right[k], n * N_FRAMES);
    }
    for (int i = 0; i < N_VIEWS; i++)
        free(right[i]);
    c->n_frames = N_FRAMES;
}

TEST_WITH(camera_that_looks_away_should_be_found, copy_room, free_copy)
{
    saga_capture *const c = *state;
    saga_source_view *const v = &c->views[2];
    FREED_BY(saga_survey_free) saga_survey s;

    /* The camera is turned by half a turn about its own y axis. */
    for (int i = 0; i < 3; i++) {
        v->rotation[i] *= -1;
        v->rotation[6 + i] *= -1;
    }
    v->translation[0] *= -1;
    v->translation[2] *= -1;
    s = survey(c);
    assert_true(s.views[2].overlap < 0.25 && s.views[1].overlap > 0.8);
    assert_true(says(&s, "cam02 shares only "));
}

TEST_WITH(few_wide_cameras_should_be_told_of, copy_room, free_copy)
{
    saga_capture *const c = *state, four = *c;
    saga_survey s;

    four.n_points = 0;
    s = survey(&four);
    assert_true(s.free_views && says(&s, "There are no points"));
    assert_true(isnan(s.views[0].stops));
    /* Without points, the survey must use places that the cameras look at. */
    for (int v = 0; v < N_VIEWS; v++)
        assert_true(s.views[v].overlap > 0.5);
    saga_survey_free(&s);
    four.n_views = 4;
    s = survey(&four);
    assert_false(s.free_views);
    assert_true(says(&s, "degrees apart without points do not allow free "
                         "views"));
    saga_survey_free(&s);
}

TEST_WITH(camera_alone_should_be_told_of, copy_room, free_copy)
{
    saga_capture alone = *(saga_capture *)*state;
    FREED_BY(saga_survey_free) saga_survey s;

    alone.n_views = 1;
    s = survey(&alone);
    assert_true(isnan(s.views[0].angle) && isnan(s.typical_angle));
    assert_true(isnan(s.views[0].overlap) && isnan(s.views[0].late.frames));
    assert_true(says(&s, "One camera does not allow free views"));
    assert_int_equal(strcspn(s.notes, "\n") + 1, strlen(s.notes));
}

TEST_WITH(moving_camera_should_be_told_of, copy_room, free_copy)
{
    saga_capture moving = *(saga_capture *)*state;
    FREED_BY(saga_survey_free) saga_survey s;

    moving.moves = true;
    s = survey(&moving);
    assert_true(says(&s, "A single moving camera sees each moment from one"));
    for (int v = 0; v < N_VIEWS; v++)
        assert_true(isnan(s.views[v].late.frames));
}
