/* SPDX-License-Identifier: MIT
 *
 * Late cameras, estimated from matches of moving things. Cameras of both
 * built-in scenes are delayed by whole frames. Each reported delay must be
 * right within the reported tolerance, none may be reported for cameras that
 * are on time, and in the room most delays must be found.
 */
#include "capture_files.h"
#include "late_matches.h"
#include "synth_capture.h"
#include "testing.h"

enum {
    N_VIEWS = 7,
    AHEAD = 3,               /* frames before the first that is used */
    N_FRAMES = 14            /* no fewer are looked at */
};

static saga_capture film(const char *path, saga_synth_scene scene)
{
    saga_synth_options s = saga_synth_defaults(scene);

    /* Moving things in the room are small. */
    s.width = scene == SAGA_SYNTH_ROOM ? 320 : 240;
    s.height = scene == SAGA_SYNTH_ROOM ? 180 : 135;
    s.n_cameras = N_VIEWS;
    s.n_hold_out = 0;
    s.n_frames = N_FRAMES + 2 * AHEAD;
    s.n_points = 100;
    s.depth_every = 0;
    s.samples = 1;
    return synth_capture(path, &s);
}

/* Finds how late views are. Every view shows N_FRAMES frames; one of them shows
 * those that lie `by` frames earlier. */
static void find(saga_lateness late[N_VIEWS], const saga_capture *all,
                 int view, int by)
{
    saga_capture c = *all;
    saga_error error = { "" };

    c.n_frames = N_FRAMES;
    c.views = copy_of(all->views, N_VIEWS * sizeof *c.views);
    for (int v = 0; v < N_VIEWS; v++)
        c.views[v].rgb += saga_view_frame_nbytes(c.views + v) *
                          (size_t)(AHEAD - (v == view ? by : 0));
    if (!saga_late_matches_find(late, &c, &error))
        fail_msg("%s", error.message);
    free(c.views);
}

/* Counts the delays that are reported for planted cameras; each must be right.
 */
static void plant(const saga_capture *c, int *n_told, int *n)
{
    static const int by[] = { -2, 3, 0, 1 };
    saga_lateness late[N_VIEWS];

    for (int i = 0; i < (testing_long() ? 4 : 2); i++) {
        const int view = (2 * i + 1) % N_VIEWS;

        find(late, c, view, by[i]);
        for (int v = 0; v < N_VIEWS; v++) {
            const double off = late[v].frames - (v == view ? by[i] : 0);

            assert_int_equal(isnan(off), isnan(late[v].tolerance));
            if (!isnan(off) && !(fabs(off) <= late[v].tolerance))
                fail_msg("camera %d of %d frames is told %.2f +-%.2f late", v,
                         v == view ? by[i] : 0, late[v].frames,
                         late[v].tolerance);
            *n_told += v == view && !isnan(off);
        }
        ++*n;
    }
}

TEST(lateness_should_be_told_by_what_moves)
{
    for (int scene = 0; scene < (testing_long() ? 2 : 1); scene++) {
        void *f;
        saga_capture c;
        int n_told = 0, n = 0;

        assert_int_equal(folder_make(&f), 0);
        c = film(folder_file(f, "scene"), scene ? SAGA_SYNTH_RING
                                                : SAGA_SYNTH_ROOM);
        folder_remove(&f);
        plant(&c, &n_told, &n);
        print_message("%s: told %d of %d\n", scene ? "ring" : "room", n_told,
                      n);
        assert_true(scene || n_told >= n - 1);
        saga_capture_free(&c);
    }
}

TEST(too_little_should_tell_nothing)
{
    saga_lateness late[N_VIEWS];
    saga_capture c;
    saga_error error = { "" };
    void *f;

    assert_int_equal(folder_make(&f), 0);
    c = film(folder_file(f, "scene"), SAGA_SYNTH_RING);
    folder_remove(&f);
    /* A film that stands still, one that is too short, two cameras. */
    for (int v = 0; v < N_VIEWS; v++)
        for (int k = 1; k < c.n_frames; k++)
            memcpy(c.views[v].rgb + saga_view_frame_nbytes(c.views + v) *
                                    (size_t)k,
                   c.views[v].rgb, saga_view_frame_nbytes(c.views + v));
    for (int trial = 0; trial < 3; trial++) {
        saga_capture d = c;

        d.n_frames = trial == 1 ? N_FRAMES - 1 : c.n_frames;
        d.n_views = trial == 2 ? 2 : N_VIEWS;
        assert_true(saga_late_matches_find(late, &d, &error));
        for (int v = 0; v < d.n_views; v++)
            assert_true(isnan(late[v].frames));
    }
    saga_capture_free(&c);
}
