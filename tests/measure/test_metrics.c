/* SPDX-License-Identifier: MIT
 *
 * PSNR, SSIM and MS-SSIM are compared with their definitions and with known
 * values.
 */
#include "score.h"
#include "ref_ssim.h"
#include "testing.h"

#define PAIR(...) ((const saga_picture_pair){ __VA_ARGS__ })

static saga_error error;

static uint32_t next(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

/* Makes a picture with edges and gradients, and a damaged copy of it. */
static void make_pair(uint8_t **a, uint8_t **b, int width, int height,
                      uint32_t seed)
{
    const size_t n = 3 * (size_t)width * (size_t)height;

    *a = must(malloc(n));
    *b = must(malloc(n));
    for (size_t i = 0; i < n; i++) {
        const int x = (int)(i / 3) % width, y = (int)(i / 3) / width;
        const int v = (x / 7 + y / 5) % 2 ? 40 + x % 180
                                          : 200 - (y + (int)(i % 3) * 30) % 90;
        const int w = v + (int)(next(&seed) % 41) - 20;

        (*a)[i] = (uint8_t)v;
        (*b)[i] = (uint8_t)(w < 0 ? 0 : w > 255 ? 255 : w);
    }
}

/* --- Definitions --------------------------------------------------------- */

/* Returns one channel of a picture as reals in [0, 1]. */
static double *plane_of(const uint8_t *rgb, int width, int height, int c)
{
    const size_t n = (size_t)width * (size_t)height;
    double *const v = must(malloc(n * sizeof *v));

    for (size_t i = 0; i < n; i++)
        v[i] = rgb[3 * i + (size_t)c] / 255.0;
    return v;
}

/* Computes SSIM and contrast-structure of the window whose first sample is at
 * x, y. */
static void window(double out[2], const double *a, const double *b, int width)
{
    double m[5] = { 0.0 }, norm = 0.0, cs;

    for (int i = 0; i < 121; i++) {
        const int dx = i % 11 - 5, dy = i / 11 - 5;
        const double w = exp(-(dx * dx + dy * dy) / 4.5);
        const double p = a[(i / 11) * width + i % 11];
        const double q = b[(i / 11) * width + i % 11];

        norm += w;
        m[0] += w * p;
        m[1] += w * q;
        m[2] += w * p * p;
        m[3] += w * q * q;
        m[4] += w * p * q;
    }
    for (int i = 0; i < 5; i++)
        m[i] /= norm;
    cs = (2.0 * (m[4] - m[0] * m[1]) + 9e-4) /
         (m[2] - m[0] * m[0] + m[3] - m[1] * m[1] + 9e-4);
    out[1] = cs;
    out[0] = cs * (2.0 * m[0] * m[1] + 1e-4) /
             (m[0] * m[0] + m[1] * m[1] + 1e-4);
}

/* Computes the means over all windows that lie within the picture. */
static void valid_means(double mean[2], const double *a, const double *b,
                        int width, int height)
{
    const int w = width - 10, h = height - 10;

    mean[0] = mean[1] = 0.0;
    for (int i = 0; i < w * h; i++) {
        const int at = (i / w) * width + i % w;
        double one[2];

        window(one, a + at, b + at, width);
        mean[0] += one[0] / (w * h);
        mean[1] += one[1] / (w * h);
    }
}

/* Returns the means of 2 x 2 pixels. An odd side is extended by repeating its
 * last line. */
static double *half_of(const double *v, int width, int height)
{
    const int w = (width + 1) / 2, h = (height + 1) / 2;
    double *const out = must(malloc((size_t)(w * h) * sizeof *out));

    for (int i = 0; i < w * h; i++) {
        double sum = 0.0;

        for (int k = 0; k < 4; k++) {
            const int x = 2 * (i % w) + k % 2, y = 2 * (i / w) + k / 2;

            sum +=
                v[(y < height ? y : y - 1) * width + (x < width ? x : x - 1)];
        }
        out[i] = sum / 4.0;
    }
    return out;
}

static double ms_ssim_of(const double *a, const double *b, int width,
                         int height)
{
    static const double weight[5] = { 0.0448, 0.2856, 0.3001, 0.2363, 0.1333 };
    double product = 1.0;
    double *x = NULL, *y = NULL;

    for (int s = 0; s < 5; s++) {
        double mean[2], *u, *v;

        valid_means(mean, a, b, width, height);
        product *= pow(fmax(mean[s < 4], 0.0), weight[s]);
        u = half_of(a, width, height);
        v = half_of(b, width, height);
        free(x);
        free(y);
        a = x = u;
        b = y = v;
        width = (width + 1) / 2;
        height = (height + 1) / 2;
    }
    free(x);
    free(y);
    return product;
}

/* --- PSNR ---------------------------------------------------------------- */

TEST(psnr_should_have_known_values)
{
    uint8_t a[300], b[300];

    memset(a, 100, sizeof a);
    memset(b, 101, sizeof b);
    assert_true(saga_mse(a, a, sizeof a) == 0.0);
    assert_true(isinf(saga_psnr(0.0)));
    assert_true(saga_mse(a, b, sizeof a) == 1.0);
    assert_near(saga_psnr(1.0), 48.130803608679102, 1e-12);
    assert_near(saga_psnr(255.0 * 255.0), 0.0, 1e-12);
    memset(a, 0, sizeof a);
    memset(b, 255, sizeof b);
    assert_true(saga_mse(a, b, sizeof a) == 65025.0);
    b[0] = 0;
    assert_near(saga_mse(a, b, sizeof a), 65025.0 * 299 / 300, 1e-9);
    assert_true(saga_mse(a, b, 0) == 0.0);
}

/* All metrics are 1 in one picture and 4 in the other, except for a PSNR of 40
 * and 30. Means over the pictures must be those of the values; only the PSNR of
 * the mean error differs. */
TEST(means_should_be_over_pictures)
{
    const int psnr = saga_metric_called("psnr");
    const int of_mean = saga_metric_called("psnr_of_mean_mse");
    saga_score one, two, mean;
    saga_score_sum sum = { .n = 0 };

    mean = saga_score_mean(&sum);
    for (int i = 0; saga_metric_at(i); i++) {
        assert_true(isnan(saga_score_told(&mean, i)));
        one.value[i] = 1.0;
        two.value[i] = 4.0;
    }
    one.value[psnr] = 40.0;
    two.value[psnr] = 30.0;
    saga_score_add(&sum, &one);
    saga_score_add(&sum, &two);
    mean = saga_score_mean(&sum);
    assert_near(saga_score_told(&mean, psnr), 35.0, 1e-12);
    assert_near(saga_score_told(&mean, of_mean), 10.0 * log10(65025.0 / 2.5),
                1e-12);
    assert_near(saga_score_told(&mean, saga_metric_called("mse")), 2.5, 1e-12);
    assert_near(saga_score_told(&mean, saga_metric_called("ms_ssim")), 2.5,
                1e-12);
}

/* One of two pixels is wrong by 51 in each channel, the other is right. If only
 * one pixel counts, which is the wrong one, the PSNR must be 20 log10(255 / 51)
 * = 14 dB; if both count, 3 dB more. */
TEST(masked_pixels_should_not_count)
{
    const uint8_t a[6] = { 51, 51, 51, 9, 9, 9 }, b[6] = { 0, 0, 0, 9, 9, 9 };
    const saga_score_options quick = { .no_ssim = true };
    saga_score all, half;

    assert_true(
        saga_score_pair(&all, &PAIR(a, b, 2, 1, 1), 1.0, &quick, &error));
    assert_true(
        saga_score_pair(&half, &PAIR(a, b, 2, 1, 1), 0.5, &quick, &error));
    for (int i = 0; i < 2; i++) {
        const int m = saga_metric_called(i ? "psnr_of_mean_mse" : "psnr");

        assert_near(saga_score_told(&half, m), 20.0 * log10(5.0), 1e-9);
        assert_near(saga_score_told(&all, m),
                    20.0 * log10(5.0) + 10.0 * log10(2.0), 1e-9);
    }
    assert_near(half.value[saga_metric_called("mse")], 51.0 * 51.0, 1e-9);
    assert_true(isnan(half.value[saga_metric_called("ssim_zero")]));
    assert_true(isnan(half.value[saga_metric_called("lpips")]));
}

/* A metric that curves show must have a column, a direction and a key of its
 * own. */
TEST(metrics_should_have_all_that_tables_need)
{
    const saga_metric_row *m;

    for (int i = 0; (m = saga_metric_at(i)); i++) {
        assert_int_equal(saga_metric_called(m->key), i);
        assert_true(!m->compared || (m->label && m->better != 0));
        assert_true(!m->table || (m->label && m->width > 0));
        assert_true(!m->label || strlen(m->label) < 10);
    }
}

/* --- SSIM ---------------------------------------------------------------- */

TEST(ssim_should_be_its_definition)
{
    static const int size[][2] = {
        { 37, 29 }, { 16, 16 }, { 11, 11 }, { 64, 17 }, { 12, 33 }
    };

    for (size_t i = 0; i < sizeof size / sizeof size[0]; i++) {
        const int w = size[i][0], h = size[i][1];
        double zero, valid, want_zero = 0.0, want_valid = 0.0;
        uint8_t *a, *b;

        make_pair(&a, &b, w, h, (uint32_t)i + 1);
        for (int c = 0; c < 3; c++) {
            FREED double *const x = plane_of(a, w, h, c);
            FREED double *const y = plane_of(b, w, h, c);
            double mean[2];

            valid_means(mean, x, y, w, h);
            want_zero += ref_ssim(x, y, w, h) / 3.0;
            want_valid += mean[0] / 3.0;
        }
        assert_true(saga_ssim(&zero, &valid, &PAIR(a, b, w, h, 1), &error));
        assert_near(zero, want_zero, 1e-11);
        assert_near(valid, want_valid, 1e-11);
        free(a);
        free(b);
    }
}

TEST(ssim_should_have_known_values)
{
    enum { SIDE = 24, N = 3 * SIDE * SIDE };
    uint8_t a[N], b[N];
    double zero, valid;

    memset(a, 0, sizeof a);
    memset(b, 255, sizeof b);
    assert_true(saga_ssim(&zero, &valid, &PAIR(a, a, SIDE, SIDE, 1), &error));
    assert_near(zero, 1.0, 1e-15);
    assert_near(valid, 1.0, 1e-15);
    /* The pictures are flat, so that only the luminance term C1 / (1 + C1) is
     * left. */
    assert_true(saga_ssim(&zero, &valid, &PAIR(a, b, SIDE, SIDE, 1), &error));
    assert_near(valid, 1e-4 / 1.0001, 1e-12);
    /* With zeros around the picture, its border counts as structure of b. */
    assert_true(zero < valid && zero > 0.0);
}

TEST(ssim_should_say_when_it_is_undefined)
{
    uint8_t *a, *b;
    double zero, valid;

    make_pair(&a, &b, 10, 40, 3);
    assert_true(saga_ssim(&zero, &valid, &PAIR(a, b, 10, 40, 1), &error));
    assert_true(isnan(valid) && zero > 0.0 && zero < 1.0);
    assert_true(saga_ssim(&zero, &valid, &PAIR(a, b, 1, 1, 1), &error));
    assert_true(isnan(valid) && isfinite(zero));
    free(a);
    free(b);
}

TEST(threads_should_not_change_a_score)
{
    enum { W = 170, H = 165 };
    const saga_score_options all = { .no_ssim = false };
    saga_score one, many;
    uint8_t *a, *b;

    make_pair(&a, &b, W, H, 4);
    assert_true(saga_score_pair(&one, &PAIR(a, b, W, H, 1), 1.0, &all, &error));
    for (int threads = 2; threads <= 5; threads++) {
        assert_true(saga_score_pair(&many, &PAIR(a, b, W, H, threads), 1.0,
                                    &all, &error));
        for (int i = 0; saga_metric_at(i); i++)
            assert_true(one.value[i] == many.value[i] ||
                        (isnan(one.value[i]) && isnan(many.value[i])));
    }
    free(a);
    free(b);
}

/* --- MS-SSIM ------------------------------------------------------------- */

TEST(ms_ssim_should_be_its_definition)
{
    static const int size[][2] = { { 176, 176 }, { 161, 163 } };

    for (size_t i = 0; i < 2; i++) {
        const int w = size[i][0], h = size[i][1];
        double value, want = 0.0;
        uint8_t *a, *b;

        make_pair(&a, &b, w, h, (uint32_t)i + 7);
        for (int c = 0; c < 3; c++) {
            FREED double *const x = plane_of(a, w, h, c);
            FREED double *const y = plane_of(b, w, h, c);

            want += ms_ssim_of(x, y, w, h) / 3.0;
        }
        assert_true(saga_ms_ssim(&value, &PAIR(a, b, w, h, 2), &error));
        assert_near(value, want, 1e-11);
        assert_true(saga_ms_ssim(&value, &PAIR(a, a, w, h, 1), &error));
        assert_near(value, 1.0, 1e-12);
        free(a);
        free(b);
    }
}

TEST(ms_ssim_should_need_161_pixels)
{
    uint8_t *a, *b;
    double value;

    make_pair(&a, &b, 161, 161, 5);
    assert_true(saga_ms_ssim(&value, &PAIR(a, b, 161, 161, 1), &error));
    assert_true(value > 0.0 && value < 1.0);
    assert_true(saga_ms_ssim(&value, &PAIR(a, b, 160, 161, 1), &error));
    assert_true(isnan(value));
    assert_true(saga_ms_ssim(&value, &PAIR(a, b, 161, 160, 1), &error));
    assert_true(isnan(value));
    free(a);
    free(b);
}

/* The negative of a picture has the opposite structure, which must give 0, not
 * NaN. */
TEST(ms_ssim_should_count_the_opposite_as_zero)
{
    enum { SIDE = 161 };
    uint8_t *a, *b;
    double value;

    make_pair(&a, &b, SIDE, SIDE, 6);
    for (size_t i = 0; i < 3 * SIDE * SIDE; i++)
        b[i] = (uint8_t)(255 - a[i]);
    assert_true(saga_ms_ssim(&value, &PAIR(a, b, SIDE, SIDE, 1), &error));
    assert_true(value == 0.0);
    free(a);
    free(b);
}
