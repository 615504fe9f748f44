/* SPDX-License-Identifier: MIT
 *
 * The picture loss in float: near the definition, the same bits for any number
 * of threads.
 */
#include "picture_loss.h"
#include "ref_ssim.h"
#include "rng.h"

#include <math.h>
#include <omp.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka wants the headers above. */
#include <cmocka.h>

enum { W = 141, H = 83, PLANE = W * H, N = 3 * PLANE };

static saga_error error; /* nothing fails here */

static saga_canvas pictures(void)
{
    const saga_rng r = saga_rng_stream(5, 0);
    saga_canvas c;
    int i;

    assert_true(saga_canvas_init(&c, PLANE, &error));
    c.camera.width = W;
    c.camera.height = H;
    for (i = 0; i < N; i++) {
        c.image[i] = 0.5f + 0.5f * sinf((float)i * 0.03f);
        c.truth[i] = c.image[i] +
                     0.1f * (saga_rng_float(r, (uint64_t)i) - 0.5f);
        if (i % W < 60)
            c.image[i] = c.truth[i] = 0.9f;
    }
    return c;
}

static void loss_should_be_near_the_definition(void **state)
{
    const saga_loss_weights weights = { 1, 1 };
    saga_canvas canvas = pictures();
    double *const x = malloc(2 * N * sizeof *x);
    saga_picture_loss out;
    double want = 0;
    int i, c;

    (void)state;
    for (i = 0; i < N; i++) {
        x[i] = (double)canvas.image[i];
        x[N + i] = (double)canvas.truth[i];
    }
    for (c = 0; c < 3; c++)
        want += ref_ssim(x + c * PLANE, x + N + c * PLANE, W, H) / 3;
    assert_true(saga_loss_picture(&out, &canvas, canvas.image, &weights,
                                  &error));
    printf("  SSIM %.6f, float error %.1e\n", want, fabs(out.ssim - want));
    assert_true(fabs(out.ssim - want) < 1e-6);
    saga_canvas_free(&canvas);
    free(x);
}

static void loss_should_be_one_for_equal_pictures(void **state)
{
    const saga_loss_weights weights = saga_loss_paper();
    saga_canvas c = pictures();
    saga_picture_loss out;
    int i;

    (void)state;
    assert_true(saga_loss_picture(&out, &c, c.truth, &weights, &error));
    assert_true(fabs(out.ssim - 1) < 1e-6);
    assert_true(out.l1 == 0 && out.mse == 0);
    for (i = 0; i < N; i++)
        assert_true(fabsf(c.d_image[i]) < 1e-3f / N);
    saga_canvas_free(&c);
}

static void loss_should_not_depend_on_threads(void **state)
{
    const saga_loss_weights weights = saga_loss_paper();
    float *const d = malloc(N * sizeof *d);
    saga_picture_loss out, kept;
    int threads;

    (void)state;
    for (threads = 1; threads <= 3; threads++) {
        saga_canvas c = pictures();

        omp_set_num_threads(threads);
        assert_true(saga_loss_picture(&out, &c, c.image, &weights, &error));
        if (threads == 1) {
            kept = out;
            memcpy(d, c.d_image, N * sizeof *d);
        }
        assert_memory_equal(&kept, &out, sizeof out);
        assert_memory_equal(d, c.d_image, N * sizeof *d);
        saga_canvas_free(&c);
    }
    free(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loss_should_be_near_the_definition),
        cmocka_unit_test(loss_should_be_one_for_equal_pictures),
        cmocka_unit_test(loss_should_not_depend_on_threads)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
