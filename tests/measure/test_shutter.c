/* SPDX-License-Identifier: MIT
 *
 * The estimate of a rolling shutter is tested on pictures of a moving wave. A
 * camera that takes its rows one after the other must be distinguished from one
 * that is late as a whole, and both from other faults of a film.
 */
#include "shutter.h"
#include "testing.h"

enum { WIDTH = 64, HEIGHT = 48, PIXELS = WIDTH * HEIGHT, FRAMES = 8,
       CAMERAS = 3 };

/* A camera's delay at its middle row, and by how much its last row is later
 * than its first, both in frames. */
typedef struct { double late, readout; } camera;

/* Draws a pattern with four waves in the width, which move by 0.4 waves in 10
 * frames, with noise of at most `noise` levels. */
static void wave(uint8_t *rgb, double time, camera c, int noise)
{
    for (int i = 0; i < PIXELS; i++) {
        const double row = (i / WIDTH + 0.5) / HEIGHT - 0.5;
        const double t = time + c.late + c.readout * row;
        const double x = i % WIDTH / 16.0 - 0.04 * t;

        for (int k = 0; k < 3; k++) {
            const int off = noise ? rand() % (2 * noise + 1) - noise : 0;

            rgb[3 * i + k] = (uint8_t)lrint(
                128 + 60 * sin(6.283185307179586 * (x + 0.2 * k)) + off);
        }
    }
}

static void look(saga_shutter *to, camera c, int noise, int n_frames)
{
    static uint8_t truth[3 * PIXELS], rgb[3][3 * PIXELS];
    const saga_shutter_drawn drawn = { rgb[0], rgb[1], rgb[2] };
    const camera exact = { 0, 0 };

    *to = (saga_shutter){ .n_pictures = 0 };
    for (int k = 0; k < n_frames; k++) {
        const double t = 3.3 * k;

        wave(truth, t, c, noise);
        for (int i = 0; i < 3; i++)
            wave(rgb[i], t + 0.5 * (i - 1), exact, 0);
        saga_shutter_add(to, truth, &drawn, WIDTH, HEIGHT);
    }
}

static saga_shutter_found *find(const camera *c, int noise, int n_frames)
{
    saga_shutter of[CAMERAS];
    saga_shutter_found *found;

    for (int i = 0; i < CAMERAS; i++)
        look(&of[i], c[i], noise, n_frames);
    assert_done(found = saga_shutter_find(of, CAMERAS, &error));
    return found;
}

TEST(rows_read_in_turn_should_be_told)
{
    static const camera c[CAMERAS] = { { 0, 0 }, { 0.3, 0.8 }, { 0.5, 0 } };
    FREED saga_shutter_found *const found = find(c, 0, FRAMES);

    for (int i = 0; i < CAMERAS; i++) {
        assert_true(fabs(found[i].readout - c[i].readout) < 0.02);
        assert_int_equal(found[i].shows, i == 1);
    }
}

TEST(last_row_may_be_first)
{
    static const camera c[CAMERAS] = { { 0, -0.6 }, { 0, 0 }, { 0, 0.01 } };
    FREED saga_shutter_found *const found = find(c, 0, FRAMES);

    assert_true(fabs(found[0].readout + 0.6) < 0.02 && found[0].shows);
    assert_false(found[1].shows || found[2].shows);
}

/* A readout that all cameras share must be attributed to the film and not to a
 * camera. */
TEST(cameras_should_be_compared)
{
    static const camera c[CAMERAS] = { { 0, 0.8 }, { 0, 0.8 }, { 0, 0.3 } };
    FREED saga_shutter_found *const found = find(c, 0, FRAMES);

    assert_true(fabs(found[0].readout) < 0.02 && !found[0].shows);
    assert_true(fabs(found[1].readout) < 0.02 && !found[1].shows);
    assert_true(fabs(found[2].readout + 0.5) < 0.02 && found[2].shows);
}

/* The film's own bending is estimated from all cameras. A camera with a large
 * readout must be found, and a smaller one, which may come from this estimate,
 * must not be reported. */
TEST(bent_film_should_be_told_from_a_camera)
{
    static const camera c[CAMERAS] = { { 0, 0.8 }, { 0, -0.35 }, { 0, 0 } };
    FREED saga_shutter_found *const found = find(c, 0, FRAMES);

    assert_true(found[0].shows);
    assert_true(fabs(found[1].readout + 0.35) < 0.02 && !found[1].shows);
}

/* With random errors of 60 levels, as large as the pattern itself, no rolling
 * shutter may be reported, and the spread must tell the size of the errors. */
TEST(errors_should_be_told_as_spread)
{
    static const camera c[CAMERAS] = { { 0, 0 }, { 0, 0 }, { 0, 0 } };
    FREED saga_shutter_found *const found = find(c, 60, FRAMES);

    for (int i = 0; i < CAMERAS; i++) {
        assert_true(found[i].spread > 0.01 && found[i].spread < 0.2);
        assert_true(fabs(found[i].readout) < 5 * found[i].spread);
        assert_false(found[i].shows);
    }
}

TEST(little_should_tell_nothing)
{
    static const camera c[CAMERAS] = { { 0, 0.8 }, { 0, 0 }, { 0, 0 } };
    FREED saga_shutter_found *const few = find(c, 0, 3);
    FREED saga_shutter_found *const none = find(c, 0, 0);

    for (int i = 0; i < CAMERAS; i++) {
        assert_true(isnan(few[i].readout) && isnan(few[i].spread));
        assert_true(isnan(none[i].readout));
        assert_false(few[i].shows || none[i].shows);
    }
}
