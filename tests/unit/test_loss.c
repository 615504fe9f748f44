/* SPDX-License-Identifier: MIT
 *
 * The picture loss in float: near the definition, the same bits for any number
 * of threads and with the truth's blurs cached.
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

typedef struct { float x[N], y[N], d[N], kept[N], blurs[2 * N]; } pictures;

static pictures *new_pictures(void)
{
    pictures *const p = calloc(1, sizeof *p);
    const saga_rng r = saga_rng_stream(5, 0);
    int i;

    for (i = 0; i < N; i++) {
        p->x[i] = 0.5f + 0.5f * sinf((float)i * 0.03f);
        p->y[i] = p->x[i] + 0.1f * (saga_rng_float(r, (uint64_t)i) - 0.5f);
        if (i % W < 60)
            p->x[i] = p->y[i] = 0.9f;
    }
    return p;
}

static void loss_should_be_near_the_definition(void **state)
{
    const saga_loss_weights weights = { 1, 1 };
    pictures *const p = new_pictures();
    double *const x = malloc(2 * N * sizeof *x);
    saga_loss_work work = { 0 };
    saga_picture_loss out;
    double want = 0;
    int i, c;

    (void)state;
    for (i = 0; i < N; i++) {
        x[i] = (double)p->x[i];
        x[N + i] = (double)p->y[i];
    }
    for (c = 0; c < 3; c++)
        want += ref_ssim(x + c * PLANE, x + N + c * PLANE, W, H) / 3;
    saga_loss_picture(&out, p->d, &work, p->x, p->y, NULL, W, H, &weights);
    printf("  SSIM %.6f, float error %.1e\n", want, fabs(out.ssim - want));
    assert_true(fabs(out.ssim - want) < 1e-6);
    saga_loss_free(&work);
    free(x);
    free(p);
}

static void loss_should_be_one_for_equal_pictures(void **state)
{
    const saga_loss_weights weights = saga_loss_paper(0.2f);
    pictures *const p = new_pictures();
    saga_loss_work work = { 0 };
    saga_picture_loss out;
    int i;

    (void)state;
    saga_loss_picture(&out, p->d, &work, p->x, p->x, NULL, W, H, &weights);
    assert_true(fabs(out.ssim - 1) < 1e-6);
    assert_true(out.l1 == 0 && out.mse == 0);
    for (i = 0; i < N; i++)
        assert_true(fabsf(p->d[i]) < 1e-3f / N);
    saga_loss_free(&work);
    free(p);
}

static void loss_should_not_depend_on_threads_or_cache(void **state)
{
    const saga_loss_weights weights = saga_loss_paper(0.2f);
    pictures *const p = new_pictures();
    saga_picture_loss out, kept;
    int threads;

    (void)state;
    for (threads = 1; threads <= 6; threads++) {
        saga_loss_work work = { 0 };

        omp_set_num_threads((threads + 1) / 2);
        if (threads % 2 == 0)
            saga_loss_blur_truth(p->blurs, &work, p->y, W, H);
        saga_loss_picture(&out, p->d, &work, p->x, p->y,
                          threads % 2 ? NULL : p->blurs, W, H, &weights);
        if (threads == 1) {
            kept = out;
            memcpy(p->kept, p->d, sizeof p->d);
        }
        assert_memory_equal(&kept, &out, sizeof out);
        assert_memory_equal(p->kept, p->d, sizeof p->d);
        saga_loss_free(&work);
    }
    free(p);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(loss_should_be_near_the_definition),
        cmocka_unit_test(loss_should_be_one_for_equal_pictures),
        cmocka_unit_test(loss_should_not_depend_on_threads_or_cache)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
