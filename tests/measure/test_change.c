/* SPDX-License-Identifier: MIT
 *
 * The temporal median picture and the PSNR of changing pixels are tested on a
 * sequence made by hand, medians also by sorting.
 */
#include "change.h"
#include "testing.h"

/* --- By hand ------------------------------------------------------------- */

/* Five frames of four pixels. The first pixel stands still. The second has a
 * red that changes around 100; the third a green that differs from 50 by at
 * most 8, and once by 9; the fourth differs by 8 in all channels. */
static const uint8_t film[5][12] = {
    { 10, 20, 30, 0, 7, 7, 5, 50, 5, 90, 90, 90 },
    { 10, 20, 30, 0, 7, 7, 5, 50, 5, 98, 82, 98 },
    { 10, 20, 30, 100, 7, 7, 5, 58, 5, 90, 90, 90 },
    { 10, 20, 30, 200, 7, 7, 5, 42, 5, 82, 98, 90 },
    { 10, 20, 30, 255, 7, 7, 5, 59, 5, 90, 90, 82 }
};
static const uint8_t film_median[12] = { 10, 20, 30, 100, 7,  7,
                                         5,  50, 5,  90,  90, 90 };

TEST(median_should_be_the_middle_value)
{
    const uint8_t *frame[5];
    uint8_t median[12];

    for (int i = 0; i < 5; i++)
        frame[i] = film[i];
    saga_median_picture(median, frame, 5, sizeof median, 1);
    assert_memory_equal(median, film_median, sizeof median);
    saga_median_picture(median, frame, 1, sizeof median, 1);
    assert_memory_equal(median, film[0], sizeof median);
    /* The medians of frames 0 to 3, where red is 0, 0, 100, 200 and green 42,
     * 50, 50, 58. */
    saga_median_picture(median, frame, 4, sizeof median, 1);
    assert_int_equal(median[3], 50);
    assert_int_equal(median[7], 50);
    /* The medians of frames 2 and 3, where red is 100, 200, green 58, 42 and
     * grey 90, 82. */
    saga_median_picture(median, frame + 2, 2, sizeof median, 1);
    assert_int_equal(median[3], 150);
    assert_int_equal(median[7], 50);
    assert_int_equal(median[9], 86);
}

TEST(median_should_round_halves_up)
{
    static const uint8_t a[3] = { 0, 254, 255 }, b[3] = { 1, 255, 255 };
    const uint8_t *const frame[2] = { a, b };
    uint8_t median[3];

    saga_median_picture(median, frame, 2, sizeof median, 1);
    assert_int_equal(median[0], 1);
    assert_int_equal(median[1], 255);
    assert_int_equal(median[2], 255);
}

/* The second pixel changes in frames 0, 1, 3 and 4, the third in frame 4. Only
 * errors in these may count. */
TEST(psnr_should_be_of_changing_pixels_only)
{
    saga_change sum = { 0 }, all = { 0 };

    for (int i = 0; i < 5; i++) {
        uint8_t picture[12];

        memcpy(picture, film[i], sizeof picture);
        picture[0] = 255; /* this pixel stands still: no
                           * error */
        picture[9] = 0;
        /* Where it equals the median, the second pixel does not change: no
         * error. */
        picture[3] = film[i][3] == 100 ? 0 : film[i][3];
        if (i == 0)
            picture[4] += 6; /* 36: all channels count */
        if (i == 4) {
            picture[7] -= 3; /* an error of 9 */
            picture[8] += 5; /* an error of 25 */
        }
        saga_change_add(&sum, film_median, film[i], picture, 4);
    }
    assert_int_equal(sum.n_pixels, 20);
    assert_int_equal(sum.n_changing, 5);
    assert_int_equal(sum.error, 70);
    assert_near(saga_change_share(&sum), 0.25, 1e-15);
    assert_near(saga_change_psnr(&sum), 10 * log10(65025.0 * 15 / 70), 1e-12);
    saga_change_merge(&all, &sum);
    saga_change_merge(&all, &sum);
    assert_near(saga_change_share(&all), 0.25, 1e-15);
    assert_near(saga_change_psnr(&all), saga_change_psnr(&sum), 1e-12);
}

TEST(nothing_should_be_undefined_and_right_infinite)
{
    saga_change sum = { 0 };

    assert_true(isnan(saga_change_psnr(&sum)));
    assert_true(isnan(saga_change_share(&sum)));
    saga_change_add(&sum, film_median, film_median, film[0], 4);
    assert_true(isnan(saga_change_psnr(&sum)));
    assert_true(saga_change_share(&sum) == 0.0);
    saga_change_add(&sum, film_median, film[0], film[0], 4);
    assert_true(isinf(saga_change_psnr(&sum)));
    assert_true(saga_change_share(&sum) == 0.125);
}

/* --- By sorting ---------------------------------------------------------- */

static int compare(const void *a, const void *b)
{
    return *(const uint8_t *)a - *(const uint8_t *)b;
}

static void check_sorted(int n_frames, size_t n, uint32_t seed, int n_threads)
{
    FREED uint8_t *const samples = malloc((size_t)n_frames * n);
    FREED uint8_t *const median = malloc(n + 1);
    const uint8_t *frame[32];
    uint8_t column[32];

    assert_true(samples && median);
    median[n] = 0xa5;
    for (size_t i = 0; i < (size_t)n_frames * n; i++) {
        seed = seed * 1664525u + 1013904223u;
        samples[i] = (uint8_t)(seed >> (i % 5 ? 24 : 30));
    }
    for (int f = 0; f < n_frames; f++)
        frame[f] = samples + (size_t)f * n;
    saga_median_picture(median, frame, n_frames, n, n_threads);
    for (size_t i = 0; i < n; i++) {
        const int low = (n_frames - 1) / 2, high = n_frames / 2;

        for (int f = 0; f < n_frames; f++)
            column[f] = frame[f][i];
        qsort(column, (size_t)n_frames, 1, compare);
        assert_int_equal(median[i],
                         (int)floor((column[low] + column[high]) / 2.0 + 0.5));
    }
    assert_int_equal(median[n], 0xa5);
}

TEST(median_should_be_what_sorting_gives)
{
    static const size_t size[] = { 1, 3, 63, 64, 65, 300 };

    for (int n_frames = 1; n_frames <= 32; n_frames++)
        for (size_t i = 0; i < sizeof size / sizeof size[0]; i++)
            check_sorted(n_frames, size[i],
                         (uint32_t)(37 * n_frames) + (uint32_t)i,
                         1 + n_frames % 3);
}
