/* SPDX-License-Identifier: MIT
 *
 * Before the first iteration a long film is looked at in a few frames only
 * (moments), because each picture that is touched is read from the disk. The
 * film of these tests is kept as filmed in a scratch file, where every picture
 * that was touched has been converted.
 */
#include "exposure_match.h"
#include "flat_state.h"
#include "tiny_training.h"

enum { W = 72, H = 48, VIEWS = 5, ORIGINAL = 4, FRAMES = 400 };

/* Brightness of the cameras; the first one is held out. */
static const double factor[VIEWS] = { 1, 0.8, 1.1, 0.9, 1.15 };

/* Fills a place of RGB with a grey picture as a video holds it. */
static void film_picture(uint8_t *to, const uint8_t *rgb, double gain)
{
    for (size_t i = 0; i < W * H; i++)
        to[i] = (uint8_t)fmin(235, 16 + gain * 0.8 * rgb[3 * i + 1]);
    memset(to + W * H, 128, W * H / 2);
}

/* Makes a film that repeats the frames of a capture, which keeps its cameras
 * and points. */
static saga_capture film_of(const saga_capture *c)
{
    const size_t n = 3 * W * H;
    saga_capture film = *c;

    film.n_frames = FRAMES;
    film.views = copy_of(c->views, VIEWS * sizeof *film.views);
    film.room = must(malloc(saga_filmed_room(W) + n));
    assert_done(
        saga_scratch_make(&film.pixels, "/tmp", VIEWS * FRAMES * n, &error));
    for (size_t v = 0; v < VIEWS; v++) {
        saga_source_view *const to = film.views + v;

        to->rgb = film.pixels.at + v * FRAMES * n;
        to->as_filmed = must(malloc(FRAMES * sizeof *to->as_filmed));
        assert_true(saga_filmed_init(&to->filmed, 8, "bt709", false));
        for (size_t k = 0; k < FRAMES; k++) {
            film_picture(to->rgb + k * n,
                         saga_capture_frame(c, (int)v, (int)(k % ORIGINAL)),
                         factor[v]);
            to->as_filmed[k] = 1;
        }
    }
    return film;
}

static void free_film(saga_capture *film)
{
    for (int v = 0; v < VIEWS; v++)
        free((void *)film->views[v].as_filmed);
    free(film->views);
    free(film->room);
    saga_scratch_free(&film->pixels);
}

/* Returns the number of pictures of a view that were touched. */
static int touched(const saga_capture *film, int view)
{
    int n = 0;

    for (int k = 0; k < FRAMES; k++)
        n += film->views[view].as_filmed[k] == 0;
    return n;
}

/* Of four training views, 256 pictures are 64 moments. Besides these, points
 * are looked for in frame 0, and the background in 256 pictures. */
TEST(few_pictures_should_be_read_before_training)
{
    enum { MOMENTS = 64, TRAIN = VIEWS - 1 };
    saga_synth_options s = synth_options(W, H, VIEWS, ORIGINAL, 120);
    FREED_BY(saga_capture_free) saga_capture c = tiny_capture(&s);
    FREED_BY(free_film) saga_capture film = film_of(&c);
    saga_flat_options o = saga_flat_defaults();
    saga_pictures p;
    saga_flat *f;
    int n = 0;

    assert_done(saga_pictures_init(&p, &film, &error));
    assert_int_equal(p.n_train, TRAIN);
    for (int v = 0; v < VIEWS; v++)
        n += touched(&film, v);
    assert_int_equal(n, 256);
    assert_done(saga_exposure_find(&p, 1, &error));
    o.n_primitives = 500;
    o.n_iterations = 100;
    assert_done(f = saga_flat_new(&p, &o, &error));
    n = 0;
    for (int v = 0; v < VIEWS; v++)
        n += touched(&film, v);
    assert_true(n <= 256 + TRAIN * (MOMENTS + 1));
    for (int v = 0; v < VIEWS; v++)
        assert_true(c.views[v].held_out == (touched(&film, v) == 0));
    saga_flat_free(f);
    /* Exposures that were found from few pictures must be right. */
    for (int i = 1; i < p.n_train; i++) {
        const int a = p.train[i], b = p.train[0];

        assert_near(p.exposure[3 * a] * factor[a] /
                        (p.exposure[3 * b] * factor[b]),
                    1, 0.03);
    }
    saga_pictures_free(&p);
}

/* Moments are distinct, in order and evenly spread; each lies in its own part
 * of the film, which is a single frame if the film has no more frames than
 * moments. */
TEST(moments_should_be_spread_evenly)
{
    static const int n_train[] = { 1, 4, 8, 20, 300 };
    static const int most[] = { 256, 64, 32, 32, 32 };

    for (int i = 0; i < 5; i++)
        for (int n = 1; n < 700; n++) {
            const saga_capture c = { .n_frames = n };
            const saga_pictures p = { .capture = &c, .n_train = n_train[i] };
            const int m = saga_pictures_n_moments(&p);

            assert_int_equal(m, n < most[i] ? n : most[i]);
            for (int k = 0; k < m; k++) {
                const int at = saga_pictures_moment(&p, k);

                assert_int_equal(saga_pictures_moment_of(&p, at), at);
                assert_true(fabs(at + 0.5 - (k + 0.5) * n / m) <= 0.5);
            }
            for (int g = 0; g < n; g++)
                assert_true(abs(saga_pictures_moment_of(&p, g) - g) <=
                            (n == m ? 0 : n / (2 * m) + 1));
        }
}
