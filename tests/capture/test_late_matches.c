/* SPDX-License-Identifier: MIT
 *
 * How late a camera is, found by matches of what moves: exactly in a film that
 * is drawn here and, in long runs, within its tolerance in the built-in scenes.
 */
#include "capture_files.h"
#include "gen_stream.h"
#include "late_matches.h"
#include "synth_capture.h"
#include "testing.h"

enum {
    AHEAD = 3,     /* frames before the first that is used */
    N_FRAMES = 14, /* the smallest number that is examined */
    N_PICTURES = N_FRAMES + 2 * AHEAD
};

/* Finds delays from N_FRAMES frames of every view; the given view shows frames
 * that were taken `by` frames earlier, as if it were late. */
static void find(saga_lateness *late, const saga_capture *all, int view, int by)
{
    saga_capture c = *all;
    saga_error error = { "" };

    c.n_frames = N_FRAMES;
    c.views = copy_of(all->views, (size_t)all->n_views * sizeof *c.views);
    for (int v = 0; v < c.n_views; v++)
        c.views[v].rgb += saga_view_frame_nbytes(c.views + v) *
                          (size_t)(AHEAD - (v == view ? by : 0));
    if (!saga_late_matches_find(late, &c, &error))
        fail_msg("%s", error.message);
    free(c.views);
}

/* --- Drawn here ---------------------------------------------------------- */

enum {
    N_VIEWS = 4,
    W = 144,
    H = 120,
    STAMP = 12,
    COLUMNS = 4,
    ROWS = 5,
    EVERY = 24, /* pixels */
    SPEED = 4   /* pixels a frame, twice what is called near */
};

/* Draws stamps of noise that move up and down in columns and re-enter at the
 * opposite edge. The cameras are side by side, so that epipolar lines are rows
 * of pixels; from camera to camera, columns are 1 or 2 pixels further left.
 * Each set of n_of_set cameras sees stamps that no other set sees. */
static void draw(uint8_t *rgb, int view, int frame, int n_of_set)
{
    memset(rgb, 128, 3 * W * H);
    for (int i = 0; i < COLUMNS * ROWS; i++) {
        const int column = i / ROWS;
        const int down = SPEED * (column % 2 ? frame : N_PICTURES - frame);
        uint64_t r = (uint64_t)(i + COLUMNS * ROWS * (view / n_of_set)) + 1;
        uint8_t grey[STAMP / 3 * STAMP / 3];

        for (int k = 0; k < STAMP / 3 * STAMP / 3; k++)
            grey[k] = (uint8_t)gen_range(&r, 0, 255);
        for (int k = 0; k < STAMP * STAMP; k++) {
            const int x = EVERY * (column + 1) + k % STAMP -
                          view * (1 + column % 2);
            const int y = (EVERY * i + down + k / STAMP) % H;

            memset(rgb + 3 * (y * W + x),
                   grey[STAMP / 3 * (k / STAMP / 3) + k % STAMP / 3], 3);
        }
    }
}

static saga_capture drawn(saga_source_view views[N_VIEWS], int n_of_set)
{
    for (int v = 0; v < N_VIEWS; v++) {
        views[v] = (saga_source_view){
            .width = W,
            .height = H,
            .fx = W,
            .fy = W,
            .cx = W / 2.0,
            .cy = H / 2.0,
            .rotation = { 1, 0, 0, 0, 1, 0, 0, 0, 1 },
            .translation = { -v, 0, 0 },
            .rgb = must(malloc((size_t)N_PICTURES * 3 * W * H))
        };
        for (int k = 0; k < N_PICTURES; k++)
            draw(views[v].rgb + (size_t)k * 3 * W * H, v, k, n_of_set);
    }
    return (saga_capture){
        .n_views = N_VIEWS, .n_frames = N_PICTURES, .fps = 24, .views = views
    };
}

static void free_drawn(saga_source_view views[N_VIEWS])
{
    for (int v = 0; v < N_VIEWS; v++)
        free(views[v].rgb);
}

/* Everything moves by 4 pixels a frame along the columns, and epipolar lines
 * are 2 pixels wide, so that a pair of views has its n matches at a single
 * shift. The view that is `by` late gets 3 n at this shift. Each other view
 * gets 2 n at shift 0, from the views on time, and n at -by, from the late one;
 * if -by is next to 0, the parabola through 0, 2 n, n has its peak 1/6 from 0.
 * The result must be exact to 0.02 frames, because n varies between pairs and
 * some corners are displaced. */
TEST(lateness_should_be_exact_where_all_matches)
{
    static const struct {
        int view, by;
        double others;
    } late_one[] = { { 1, -2, 0 }, { 3, 1, -1 / 6.0 } };
    saga_source_view views[N_VIEWS];
    const saga_capture c = drawn(views, N_VIEWS);

    for (int i = 0; i < 2; i++) {
        saga_lateness late[N_VIEWS];

        find(late, &c, late_one[i].view, late_one[i].by);
        for (int v = 0; v < N_VIEWS; v++) {
            const double is = v == late_one[i].view ? late_one[i].by
                                                    : late_one[i].others;

            if (!(fabs(late[v].frames - is) < 0.02))
                fail_msg("camera %d is told %.3f late, not %.3f", v,
                         late[v].frames, is);
            assert_true(late[v].tolerance >= 0.3 && late[v].tolerance <= 0.5);
        }
    }
    free_drawn(views);
}

/* Cameras 0 and 1 match only each other, as do cameras 2 and 3. Camera 1 is two
 * frames late, which looks as if camera 0 were two frames early. No camera must
 * be told late, because nothing says which one is. */
TEST(two_cameras_that_match_only_each_other_should_tell_nothing)
{
    saga_source_view views[N_VIEWS];
    const saga_capture c = drawn(views, 2);
    saga_lateness late[N_VIEWS];

    find(late, &c, 1, 2);
    for (int v = 0; v < N_VIEWS; v++)
        if (!isnan(late[v].frames))
            fail_msg("camera %d is told %.2f late", v, late[v].frames);
    free_drawn(views);
}

/* A film that is too short, one with two cameras, and one that stands still
 * must give no delay. */
TEST(too_little_should_tell_nothing)
{
    saga_source_view views[N_VIEWS];
    const saga_capture c = drawn(views, N_VIEWS);

    for (int trial = 0; trial < 3; trial++) {
        saga_lateness late[N_VIEWS];
        saga_capture d = c;

        d.n_frames = trial == 0 ? N_FRAMES - 1 : N_FRAMES;
        d.n_views = trial == 1 ? 2 : N_VIEWS;
        for (int v = 0; v < N_VIEWS && trial == 2; v++)
            for (int k = 1; k < N_FRAMES; k++)
                memcpy(views[v].rgb + (size_t)k * 3 * W * H, views[v].rgb,
                       3 * W * H);
        assert_done(saga_late_matches_find(late, &d, &error));
        for (int v = 0; v < d.n_views; v++)
            assert_true(isnan(late[v].frames) && isnan(late[v].tolerance));
    }
    free_drawn(views);
}

/* --- Built-in scenes ----------------------------------------------------- */

enum { N_CAMERAS = 7 };

static saga_capture film(const char *path, saga_synth_scene scene)
{
    /* The moving things of the room are small and need more pixels. */
    const bool is_room = scene == SAGA_SYNTH_ROOM;
    saga_synth_options s = synth_options(
        is_room ? 320 : 240, is_room ? 180 : 135, N_CAMERAS, N_PICTURES, 100);

    s.scene = scene;
    s.n_hold_out = 0;
    s.samples = 1;
    return synth_capture(path, &s);
}

/* Every reported delay must be right within its reported tolerance. */
static void plant(const saga_capture *c, int view, int by)
{
    saga_lateness late[N_CAMERAS];

    find(late, c, view, by);
    for (int v = 0; v < N_CAMERAS; v++) {
        const double off = late[v].frames - (v == view ? by : 0);

        assert_int_equal(isnan(off), isnan(late[v].tolerance));
        if (!isnan(off) && !(fabs(off) <= late[v].tolerance))
            fail_msg("camera %d of %d frames is told %.2f +-%.2f late", v,
                     v == view ? by : 0, late[v].frames, late[v].tolerance);
    }
}

TEST(lateness_should_be_within_its_tolerance)
{
    static const int by[] = { -2, 3, 0, 1 };

    for (int scene = 0; testing_long() && scene < 2; scene++) {
        void *f;
        saga_capture c;

        assert_int_equal(folder_make(&f), 0);
        c = film(folder_file(f, "scene"),
                 scene ? SAGA_SYNTH_RING : SAGA_SYNTH_ROOM);
        folder_remove(&f);
        for (int i = 0; i < 4; i++)
            plant(&c, (2 * i + 1) % N_CAMERAS, by[i]);
        saga_capture_free(&c);
    }
}
