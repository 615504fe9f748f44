/* SPDX-License-Identifier: MIT
 *
 * The picture loss in float: near a sum in double, the same bits for any number
 * of threads.
 */
#include "picture_loss.h"
#include "rng.h"

#include <math.h>
#include <omp.h>
#include <setjmp.h>
#include <stdarg.h>
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

    assert_true(saga_canvas_init(&c, PLANE, &error));
    c.camera.width = W;
    c.camera.height = H;
    for (int i = 0; i < N; i++) {
        c.image[i] = 0.5f + 0.5f * sinf((float)i * 0.03f);
        c.truth[i] = c.image[i] +
                     0.1f * (saga_rng_float(r, (uint64_t)i) - 0.5f);
    }
    return c;
}

static void loss_should_be_near_the_definition(void **state)
{
    saga_canvas c = pictures();
    double want = 0;

    (void)state;
    for (int i = 0; i < N; i++) {
        const double e = (double)c.image[i] - (double)c.truth[i];

        want += e * e / N;
    }
    assert_true(fabs(saga_loss_picture(&c) / want - 1) < 1e-6);
    saga_canvas_free(&c);
}

static void loss_should_be_zero_for_equal_pictures(void **state)
{
    saga_canvas c = pictures();

    (void)state;
    memcpy(c.truth, c.image, N * sizeof *c.truth);
    assert_true(saga_loss_picture(&c) == 0);
    for (int i = 0; i < N; i++)
        assert_true(c.d_image[i] == 0);
    saga_canvas_free(&c);
}

static void loss_should_not_depend_on_threads(void **state)
{
    float *const d = malloc(N * sizeof *d);
    double kept = 0;

    (void)state;
    for (int threads = 1; threads <= 3; threads++) {
        saga_canvas c = pictures();
        double mse;

        omp_set_num_threads(threads);
        mse = saga_loss_picture(&c);
        if (threads == 1) {
            kept = mse;
            memcpy(d, c.d_image, N * sizeof *d);
        }
        assert_true(mse == kept);
        assert_memory_equal(d, c.d_image, N * sizeof *d);
        saga_canvas_free(&c);
    }
    free(d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loss_should_be_near_the_definition),
        cmocka_unit_test(loss_should_be_zero_for_equal_pictures),
        cmocka_unit_test(loss_should_not_depend_on_threads)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
