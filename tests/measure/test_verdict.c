/* SPDX-License-Identifier: MIT
 *
 * The verdict must separate things that stand still from things that move.
 */
#include "testing.h"
#include "verdict.h"

enum { PIXELS = 8, FRAMES = 3 };

/* Makes three frames of 8 x 1 pixels, which are equal except that the last two
 * pixels are brighter in the last frame. */
static void frames(uint8_t *rgb)
{
    memset(rgb, 100, 3 * PIXELS * FRAMES);
    memset(rgb + 3 * PIXELS * FRAMES - 6, 160, 6);
}

static void near(double value, double wanted)
{
    assert_near(value, wanted, 1e-9);
}

TEST(verdict_should_part_what_moves)
{
    uint8_t rgb[3 * PIXELS * FRAMES], made[3 * PIXELS];
    saga_source_view view = { .width = PIXELS, .height = 1, .rgb = rgb };
    const saga_capture c = { .n_views = 1, .n_frames = FRAMES, .views = &view };
    saga_verdict v = { 0 };
    FREED uint8_t *median;

    frames(rgb);
    assert_done(median = saga_verdict_median(&c, 0, &error));
    for (int i = 0; i < 3 * PIXELS; i++)
        assert_int_equal(median[i], 100);
    /* The drawn picture is wrong by 10 where the film stands still, by 20 where
     * it moves. */
    memset(made, 110, sizeof made);
    memset(made + sizeof made - 6, 140, 6);
    saga_verdict_add(&v, median, rgb + 2 * sizeof made, made, PIXELS);
    near(saga_verdict_rest(&v), 20 * log10(25.5));
    near(saga_change_psnr(&v.file), 20 * log10(12.75));
    near(saga_change_psnr(&v.still), 20 * log10(255 / 60.));
    near(saga_change_share(&v.file), 0.25);
}

TEST(verdict_should_have_words)
{
    saga_verdict v = { .file = { .n_pixels = 4, .n_changing = 4 } };

    assert_string_equal(saga_verdict_word(30), "good");
    assert_string_equal(saga_verdict_word(29.9), "fair");
    assert_string_equal(saga_verdict_word(24.9), "blurred");
    assert_true(isnan(saga_verdict_rest(&v)));
}
