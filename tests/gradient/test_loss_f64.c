/* SPDX-License-Identifier: MIT
 *
 * The picture loss in double: SSIM against its definition, gradients against
 * finite differences.
 */
#include "picture_loss.h"
#include "ref_ssim.h"
#include "rng.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka wants the headers above. */
#include <cmocka.h>

static const int sizes[][2] = { { 33, 27 }, { 16, 40 }, { 5, 3 }, { 1, 1 } };
enum { N_SIZES = sizeof sizes / sizeof *sizes };

static saga_error error; /* nothing fails here */

/* A noisy truth of a smooth image; a tenth of the pixels flat at 1. */
static saga_canvas pictures(int w, int h, uint64_t seed)
{
    const saga_rng r = saga_rng_stream(seed, 0);
    saga_canvas c;
    size_t i;

    assert_true(saga_canvas_init(&c, (size_t)(w * h), &error));
    c.camera.width = w;
    c.camera.height = h;
    for (i = 0; i < (size_t)(3 * w * h); i++) {
        c.image[i] = 0.5 + 0.4 * sin((double)i * 0.05);
        c.truth[i] = c.image[i] + 0.2 * (saga_rng_double(r, i) - 0.5);
        if (i % 100 < 10)
            c.image[i] = c.truth[i] = 1;
    }
    return c;
}

static void loss_should_match_the_definition(void **state)
{
    int k, c;

    (void)state;
    for (k = 0; k < N_SIZES; k++) {
        const int w = sizes[k][0], h = sizes[k][1];
        const size_t plane = (size_t)(w * h);
        const saga_loss_weights weights = saga_loss_paper();
        saga_canvas canvas = pictures(w, h, (uint64_t)k);
        const double *const x = canvas.image, *const y = canvas.truth;
        saga_picture_loss out;
        double ssim = 0, l1 = 0, mse = 0;
        size_t i;

        for (c = 0; c < 3; c++)
            ssim += ref_ssim(x + (size_t)c * plane, y + (size_t)c * plane, w,
                             h) / 3;
        for (i = 0; i < 3 * plane; i++) {
            l1 += fabs(x[i] - y[i]) / (double)(3 * plane);
            mse += (x[i] - y[i]) * (x[i] - y[i]) / (double)(3 * plane);
        }
        assert_true(saga_loss_picture(&out, &canvas, x, &weights, &error));
        assert_true(fabs(out.ssim - ssim) < 1e-12);
        assert_true(fabs(out.l1 - l1) < 1e-13);
        assert_true(fabs(out.mse - mse) < 1e-13);
        assert_true(fabs(out.loss - 0.8 * l1 - 0.1 * (1 - ssim)) < 1e-12);
        saga_canvas_free(&canvas);
    }
}

static double loss_at(saga_canvas *c, size_t i, double value,
                      const saga_loss_weights *weights)
{
    const double old = c->image[i];
    saga_picture_loss out;

    c->image[i] = value;
    assert_true(saga_loss_picture(&out, c, c->image, weights, &error));
    c->image[i] = old;
    return out.loss;
}

/* Differences of fourth order; pixels whose |x - y| is within two steps of its
 * corner are left out, and with sanitizers, which look at memory and not at
 * numbers, six of seven. */
static void check_gradient(int w, int h, const saga_loss_weights *weights)
{
    const size_t n = (size_t)(3 * w * h);
    const double step = 5e-5;
    const size_t every = getenv("SAGA_TEST_SANITIZED") ? 7 : 1;
    double *const d = malloc(n * sizeof *d);
    saga_canvas c = pictures(w, h, 9);
    saga_picture_loss out;
    double top = 0, worst = 0, f[4];
    size_t i;
    int k;

    assert_true(saga_loss_picture(&out, &c, c.image, weights, &error));
    memcpy(d, c.d_image, n * sizeof *d);
    for (i = 0; i < n; i++)
        top = fmax(top, fabs(d[i]));
    for (i = 0; i < n; i += every) {
        static const int at[4] = { -2, -1, 1, 2 };
        double slope;

        if (weights->l1 > 0 && fabs(c.image[i] - c.truth[i]) < 3 * step)
            continue;
        for (k = 0; k < 4; k++)
            f[k] = loss_at(&c, i, c.image[i] + at[k] * step, weights);
        slope = (8 * (f[2] - f[1]) - (f[3] - f[0])) / (12 * step);
        worst = fmax(worst, fabs(slope - d[i]) / fmax(fabs(slope) + 1e-6,
                                                      0.01 * top));
    }
    printf("  %dx%d: worst error %.1e\n", w, h, worst);
    assert_true(worst < 1e-5);
    saga_canvas_free(&c);
    free(d);
}

static void loss_gradient_should_match_differences(void **state)
{
    static const saga_loss_weights ssim = { 0, 1 }, l1 = { 1, 0 };
    const saga_loss_weights both = saga_loss_paper();
    int k;

    (void)state;
    for (k = 0; k < N_SIZES; k++) {
        check_gradient(sizes[k][0], sizes[k][1], &both);
        check_gradient(sizes[k][0], sizes[k][1], &ssim);
        check_gradient(sizes[k][0], sizes[k][1], &l1);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loss_should_match_the_definition),
        cmocka_unit_test(loss_gradient_should_match_differences)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
