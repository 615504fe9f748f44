/* SPDX-License-Identifier: MIT
 *
 * The picture loss in double: gradients against finite differences.
 */
#include "picture_loss.h"
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

static double loss_at(saga_canvas *c, size_t i, double value)
{
    const double old = c->image[i];
    double loss;

    c->image[i] = value;
    loss = saga_loss_picture(c);
    c->image[i] = old;
    return loss;
}

/* Central differences of a square are exact but for rounding. */
static void loss_gradient_should_match_differences(void **state)
{
    (void)state;
    for (int k = 0; k < N_SIZES; k++) {
        const size_t n = (size_t)(3 * sizes[k][0] * sizes[k][1]);
        const double step = 1e-2;
        double *const d = malloc(n * sizeof *d);
        saga_canvas c = pictures(sizes[k][0], sizes[k][1], 9);

        saga_loss_picture(&c);
        memcpy(d, c.d_image, n * sizeof *d);
        for (size_t i = 0; i < n; i++) {
            const double slope = (loss_at(&c, i, c.image[i] + step) -
                                  loss_at(&c, i, c.image[i] - step)) /
                                 (2 * step);

            assert_true(fabs(slope - d[i]) < 1e-11);
        }
        saga_canvas_free(&c);
        free(d);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loss_gradient_should_match_differences)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
