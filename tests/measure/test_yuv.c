/* SPDX-License-Identifier: MIT
 *
 * Luma and chroma are compared with BT.709's own numbers, WS-PSNR and IV-PSNR
 * with their definitions, which are written out here pixel by pixel.
 */
#include "testing.h"
#include "yuv.h"

enum { W = 37, H = 23, N = W * H };

static saga_error error;

static uint32_t next(uint32_t *state)
{
    *state = *state * 1664525u + 1013904223u;
    return *state >> 8;
}

/* Paints a smooth texture in which neighbouring pixels differ. */
static void paint(uint8_t *rgb, int dx, int dy, int brighter)
{
    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++)
            for (int c = 0; c < 3; c++)
                rgb[3 * (y * W + x) + c] =
                    (uint8_t)(100 + brighter + 4 * ((x + dx) % 23) +
                              (7 + c) * ((y + dy) % 9) % 40);
}

static saga_yuv_score compare(const uint8_t *a, const uint8_t *b, bool equirect)
{
    const saga_picture_pair pair = { a, b, W, H, 1 };
    saga_yuv_score s;

    assert_true(saga_yuv_compare(&s, &pair, equirect, true, &error));
    return s;
}

TEST(yuv_should_be_that_of_bt709)
{
    static const uint8_t rgb[] = { 0, 0,   0, 255, 255, 255, 255, 0,   0,
                                   0, 255, 0, 0,   0,   255, 128, 128, 128 };
    static const uint8_t want[][3] = { { 0, 128, 128 },  { 255, 128, 128 },
                                       { 54, 99, 255 },  { 182, 30, 12 },
                                       { 18, 255, 116 }, { 128, 128, 128 } };
    saga_yuv yuv;

    assert_true(saga_yuv_of(&yuv, rgb, 6, 1, &error));
    for (int i = 0; i < 6; i++) {
        assert_int_equal(yuv.y[i], want[i][0]);
        assert_int_equal(yuv.u[i], want[i][1]);
        assert_int_equal(yuv.v[i], want[i][2]);
    }
    free(yuv.y);
}

TEST(psnr_should_be_of_each_plane)
{
    static uint8_t a[3 * N], b[3 * N];
    saga_yuv ya, yb;
    saga_yuv_score s;
    uint32_t seed = 1;

    for (int i = 0; i < 3 * N; i++) {
        a[i] = (uint8_t)next(&seed);
        b[i] = (uint8_t)next(&seed);
    }
    assert_true(saga_yuv_of(&ya, a, W, H, &error));
    assert_true(saga_yuv_of(&yb, b, W, H, &error));
    s = compare(a, b, false);
    assert_near(s.psnr[0], saga_psnr(saga_mse(ya.y, yb.y, N)), 1e-12);
    assert_near(s.psnr[1], saga_psnr(saga_mse(ya.u, yb.u, N)), 1e-12);
    assert_near(s.psnr[2], saga_psnr(saga_mse(ya.v, yb.v, N)), 1e-12);
    assert_near(s.psnr_yuv, (6 * s.psnr[0] + s.psnr[1] + s.psnr[2]) / 8, 1e-12);
    assert_near(s.ws_psnr, s.psnr[0], 1e-9);
    free(ya.y);
    free(yb.y);
}

/* An error at a pole must count little, at the equator more than in the
 * mean. */
TEST(ws_psnr_should_weigh_latitudes)
{
    static uint8_t a[3 * N], b[3 * N];
    double weights = 0;

    for (int y = 0; y < H; y++)
        weights += cos(((y + 0.5) / H - 0.5) * acos(-1.0));
    paint(a, 0, 0, 0);
    for (int row = 0; row < H; row += H / 2) {
        const double latitude = ((row + 0.5) / H - 0.5) * acos(-1.0);

        memcpy(b, a, sizeof b);
        for (int i = 0; i < 3 * W; i++)
            b[3 * W * row + i] = (uint8_t)(b[3 * W * row + i] + 10);
        assert_near(compare(a, b, true).ws_psnr,
                    saga_psnr(100 * cos(latitude) / weights), 1e-9);
    }
}

/* --- IV-PSNR ------------------------------------------------------------- */

static int sample(const uint8_t *p, int x, int y)
{
    x = x < 0 ? 0 : x >= W ? W - 1 : x;
    y = y < 0 ? 0 : y >= H ? H - 1 : y;
    return p[y * W + x];
}

static int shift_of(const uint8_t *made, const uint8_t *truth)
{
    double sum = 0;

    for (int i = 0; i < N; i++)
        sum += truth[i] - made[i];
    sum = floor(sum / N + 0.5);
    return sum > 2 ? 2 : sum < -2 ? -2 : (int)sum;
}

/* Compares each pixel of `from`, plus a shift of its values, with the most
 * similar of the 25 pixels around its place in `to`. Returns the PSNR, with
 * luma counted four times. */
static double way(const saga_yuv *from, const int *from_shift,
                  const saga_yuv *to, const int *to_shift)
{
    const uint8_t *const f[3] = { from->y, from->u, from->v };
    const uint8_t *const t[3] = { to->y, to->u, to->v };
    double sum[3] = { 0, 0, 0 };

    for (int y = 0; y < H; y++)
        for (int x = 0; x < W; x++) {
            int least = 1 << 30, best[3] = { 0, 0, 0 };

            for (int k = 0; k < 25; k++) {
                int d[3];

                for (int c = 0; c < 3; c++)
                    d[c] = f[c][y * W + x] + from_shift[c] - to_shift[c] -
                           sample(t[c], x + k % 5 - 2, y + k / 5 - 2);
                if (4 * d[0] * d[0] + d[1] * d[1] + d[2] * d[2] < least) {
                    least = 4 * d[0] * d[0] + d[1] * d[1] + d[2] * d[2];
                    memcpy(best, d, sizeof best);
                }
            }
            for (int c = 0; c < 3; c++)
                sum[c] += best[c] * best[c];
        }
    for (int c = 0; c < 3; c++)
        sum[c] = saga_psnr((sum[c] > 0 ? sum[c] : 1) / N);
    return (4 * sum[0] + sum[1] + sum[2]) / 6;
}

static double iv_psnr(const uint8_t *made, const uint8_t *truth)
{
    static const int none[3] = { 0, 0, 0 };
    saga_yuv a, b;
    int shift[3];
    double there, back;

    assert_true(saga_yuv_of(&a, made, W, H, &error));
    assert_true(saga_yuv_of(&b, truth, W, H, &error));
    shift[0] = shift_of(a.y, b.y);
    shift[1] = shift_of(a.u, b.u);
    shift[2] = shift_of(a.v, b.v);
    there = way(&a, shift, &b, none);
    back = way(&b, none, &a, shift);
    free(a.y);
    free(b.y);
    return there < back ? there : back;
}

TEST(iv_psnr_should_be_its_definition)
{
    static uint8_t a[3 * N], b[3 * N];
    uint32_t seed = 5;

    for (int k = 0; k < 6; k++) {
        paint(a, 0, 0, 0);
        paint(b, k, k / 2, 2 * k - 5);
        for (int i = 0; i < 3 * N; i++)
            b[i] = (uint8_t)(b[i] + next(&seed) % 5);
        assert_near(compare(a, b, false).iv_psnr, iv_psnr(a, b), 1e-9);
        assert_near(compare(b, a, false).iv_psnr, iv_psnr(b, a), 1e-9);
    }
}

TEST(iv_psnr_should_forgive_shifts_and_brightness)
{
    static uint8_t a[3 * N], b[3 * N];
    saga_yuv_score far, shifted, brighter;

    paint(a, 0, 0, 0);
    paint(b, 2, 0, 0);
    shifted = compare(b, a, false);
    paint(b, 5, 0, 0);
    far = compare(b, a, false);
    paint(b, 0, 0, 2);
    brighter = compare(b, a, false);
    assert_near(shifted.psnr[0], far.psnr[0], 6.0);
    assert_true(shifted.iv_psnr > far.iv_psnr + 3.0);
    /* If the sum of squares is 0, it must count as 1. */
    assert_near(brighter.iv_psnr, saga_psnr(1.0 / N), 1e-9);
    assert_near(compare(a, a, false).iv_psnr, saga_psnr(1.0 / N), 1e-9);
    paint(b, 0, 0, 15);
    assert_true(compare(b, a, false).iv_psnr < brighter.iv_psnr - 20.0);
}
