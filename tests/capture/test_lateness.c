/* SPDX-License-Identifier: MIT
 *
 * Late cameras, estimated from films of both built-in scenes with known delays.
 * Each reported delay must be right within the reported tolerance. No delay may
 * be reported for a camera that shares no motion with the others.
 */
#include "lateness.h"
#include "synth_capture.h"
#include "synth_world.h"
#include "testing.h"

enum {
    W = 96,
    H = 54,
    N_VIEWS = 6,
    N_FRAMES = 70,
    AHEAD = 6, /* frames before the first that is used */
    N_PICTURES = N_FRAMES + 2 * AHEAD,
    NBYTES = 3 * W * H
};

/* Films of all cameras, taken at frame times k, and at k - 0.3. */
typedef struct films {
    uint8_t *whole[N_VIEWS], *part[N_VIEWS];
} films;

static void draw(uint8_t *rgb, const saga_synth_options *o, int camera,
                 double frame)
{
    saga_synth_world world;
    saga_source_view v;

    saga_synth_view(o, camera, &v);
    saga_synth_world_at(&world, o, frame / o->fps);
    for (int i = 0; i < W * H; i++) {
        const double x = (i % W + 0.5 - v.cx) / v.fx;
        const double y = (i / W + 0.5 - v.cy) / v.fy;
        double origin[3], d[3], light[3];

        for (int k = 0; k < 3; k++) {
            const double *const r = v.rotation + k;

            d[k] = r[0] * x + r[3] * y + r[6];
            origin[k] = -(r[0] * v.translation[0] + r[3] * v.translation[1] +
                          r[6] * v.translation[2]);
        }
        saga_synth_light(&world, origin, d, light);
        for (int k = 0; k < 3; k++)
            rgb[3 * i + k] =
                (uint8_t)(255.0 * sqrt(fmin(fmax(light[k], 0.0), 1.0)) + 0.5);
    }
}

static films shoot(saga_synth_scene scene)
{
    saga_synth_options o = saga_synth_defaults(scene);
    films f;

    o.width = W;
    o.height = H;
    o.n_cameras = N_VIEWS;
    for (int v = 0; v < N_VIEWS; v++) {
        f.whole[v] = malloc((size_t)N_PICTURES * NBYTES);
        f.part[v] = malloc((size_t)N_PICTURES * NBYTES);
        assert_non_null(f.whole[v]);
        assert_non_null(f.part[v]);
        for (int k = 0; k < N_PICTURES; k++)
            draw(f.whole[v] + k * NBYTES, &o, v, k);
        for (int k = AHEAD; v < 3 && k < AHEAD + N_FRAMES; k++)
            draw(f.part[v] + k * NBYTES, &o, v, k - 0.3);
    }
    return f;
}

static void free_films(films *f)
{
    for (int v = 0; v < N_VIEWS; v++) {
        free(f->whole[v]);
        free(f->part[v]);
    }
}

/* Finds how late all cameras are when one of them is late. */
static void find(saga_lateness late[N_VIEWS], const films *f, int view,
                 double by)
{
    const int whole = (int)floor(by);
    saga_source_view views[N_VIEWS];
    saga_capture c = { .n_views = N_VIEWS,
                       .n_frames = N_FRAMES,
                       .views = views };

    memset(views, 0, sizeof views);
    for (int v = 0; v < N_VIEWS; v++) {
        uint8_t *const film = v == view && by > whole ? f->part[v]
                                                      : f->whole[v];

        views[v].width = W;
        views[v].height = H;
        views[v].rgb = film + (AHEAD - (v == view ? whole : 0)) * NBYTES;
    }
    assert_done(saga_lateness_find(late, &c, &error));
}

/* Makes one camera after another late, and counts how often its delay is
 * reported. Every reported delay, of any camera, must be right within its
 * tolerance. */
static void plant(const films *f, double by, int *n_told, int *n)
{
    for (int v = 0; v < (by > floor(by) ? 3 : N_VIEWS); v++) {
        saga_lateness late[N_VIEWS];

        find(late, f, v, by);
        for (int i = 0; i < N_VIEWS; i++) {
            const double off = late[i].frames - (i == v ? by : 0.0);

            assert_int_equal(isnan(late[i].frames), isnan(late[i].tolerance));
            if (isnan(off))
                continue;
            assert_true(late[i].tolerance > 0.0 && late[i].tolerance < 0.7);
            if (!(fabs(off) <= late[i].tolerance))
                fail_msg("camera %d of %g frames is told %.2f +-%.2f late", i,
                         i == v ? by : 0.0, late[i].frames, late[i].tolerance);
            *n_told += i == v;
        }
        ++*n;
    }
}

TEST(lateness_should_be_right_or_not_told)
{
    static const double by[] = { 0, 0.3, 2, 3, 6, -4 };

    int whole = 0, n_whole = 0;

    for (int scene = 0; scene < 2; scene++) {
        films f = shoot(scene ? SAGA_SYNTH_RING : SAGA_SYNTH_ROOM);
        int part = 0, n_part = 0;

        for (size_t i = 0; i < sizeof by / sizeof by[0]; i++)
            if (by[i] > floor(by[i]))
                plant(&f, by[i], &part, &n_part);
            else
                plant(&f, by[i], &whole, &n_whole);
        print_message("told %d of %d of whole frames, %d of %d of 0.3\n", whole,
                      n_whole, part, n_part);
        free_films(&f);
    }
    assert_true(4 * whole >= n_whole);
}

/* A camera that shows another camera's film backwards has as much motion as the
 * others, but no delay may be reported for it. */
TEST(unrelated_motion_should_tell_nothing)
{
    saga_lateness late[N_VIEWS];
    FREED_BY(free_films) films f = shoot(SAGA_SYNTH_RING);
    FREED uint8_t *const back = must(malloc((size_t)N_PICTURES * NBYTES));

    for (int v = 0; v < N_VIEWS; v++) {
        uint8_t *const own = f.whole[v];

        for (int k = 0; k < N_PICTURES; k++)
            memcpy(back + k * NBYTES, own + (N_PICTURES - 1 - k) * NBYTES,
                   NBYTES);
        f.whole[v] = back;
        find(late, &f, v, 0);
        f.whole[v] = own;
        assert_true(isnan(late[v].frames));
    }
    /* No delay may be reported for a camera whose picture stands still. */
    memset(back, 77, (size_t)N_PICTURES * NBYTES);
    memcpy(f.whole[1], back, (size_t)N_PICTURES * NBYTES);
    find(late, &f, 1, 0);
    assert_true(isnan(late[1].frames));
}
