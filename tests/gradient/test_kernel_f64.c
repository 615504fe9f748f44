/* SPDX-License-Identifier: MIT
 *
 * Embedding and kernel interpolation in double: definitions and finite
 * differences.
 */
#include "embedding.h"
#include "kernel_interp.h"
#include "rng.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
/* cmocka wants the headers above. */
#include <cmocka.h>

#define TOLERANCE 1e-6
#define STEP 1e-5

static void random_reals(real *x, size_t n, uint64_t stream, double lo,
                         double hi)
{
    const saga_rng r = saga_rng_stream(23, stream);
    size_t i;

    for (i = 0; i < n; i++)
        x[i] = lo + (hi - lo) * saga_rng_double(r, i);
}

static double worst_error(double (*loss)(void *), void *arg, real *x,
                          const real *d, size_t n)
{
    double top = 0, worst = 0;
    size_t i;

    for (i = 0; i < n; i++)
        top = fmax(top, fabs(d[i]));
    for (i = 0; i < n; i++) {
        const double old = x[i];
        double slope;

        x[i] = old + STEP;
        slope = loss(arg);
        x[i] = old - STEP;
        slope = (slope - loss(arg)) / (2 * STEP);
        x[i] = old;
        worst = fmax(worst, fabs(slope - d[i]) / fmax(fabs(slope),
                                                      0.01 * top));
    }
    return worst;
}

/* --- Embedding ----------------------------------------------------------- */

enum { POINTS = 9, U_AXES = 4, OCTAVES = 4, WIDTH = 2 * U_AXES * OCTAVES + 3 };

typedef struct {
    real u[POINTS * U_AXES], y[POINTS * WIDTH], dy[POINTS * WIDTH];
} embedding;

static double embedding_loss(void *arg)
{
    embedding *const e = arg;
    double sum = 0;
    int i;

    saga_embedding_forward(e->y, WIDTH, e->u, POINTS, U_AXES, OCTAVES);
    for (i = 0; i < POINTS * WIDTH; i++)
        sum += e->y[i] * e->dy[i];
    return sum;
}

static void embedding_should_match_differences(void **state)
{
    embedding e;
    real du[POINTS * U_AXES] = { 0 };
    double worst;

    (void)state;
    memset(&e, 0, sizeof e);
    random_reals(e.u, POINTS * U_AXES, 1, -1.5, 1.5);
    random_reals(e.dy, POINTS * WIDTH, 2, -1, 1);
    embedding_loss(&e);
    saga_embedding_backward(du, e.dy, e.y, WIDTH, POINTS, U_AXES, OCTAVES);
    worst = worst_error(embedding_loss, &e, e.u, du, POINTS * U_AXES);
    printf("  embedding: worst error %.1e\n", worst);
    assert_true(worst < TOLERANCE);
}

static void embedding_should_be_sine_and_cosine(void **state)
{
    double u, worst = 0;

    (void)state;
    for (u = -9; u < 9; u += 0.0123) {
        real y[2 * 5];
        int k;

        saga_embedding_forward(y, 10, &u, 1, 1, 5);
        for (k = 0; k < 5; k++) {
            const double angle = acos(-1) / 2 * (1 << k) * u;

            worst = fmax(worst, fabs(y[2 * k] - sin(angle)));
            worst = fmax(worst, fabs(y[2 * k + 1] - cos(angle)));
        }
    }
    assert_true(worst < 1e-13);
}

/* --- Kernel interpolation ------------------------------------------------ */

enum { M = 11, B = 7, K = 4, F = 5 };

typedef struct {
    uint32_t index[M * K], count[M];
    real feature[B * F], source[B * 4], source_support[B * 4];
    real query[M * 4], query_support[M * 4], d_out[M * F], out[M * F];
    saga_kernel k;
    saga_kernel_values v;
    saga_kernel_work work;
} kernel;

static double kernel_loss(void *arg)
{
    kernel *const t = arg;
    double sum = 0;
    int i;

    saga_kernel_forward(t->out, &t->work, &t->v, &t->k);
    for (i = 0; i < M * F; i++)
        sum += t->out[i] * t->d_out[i];
    return sum;
}

/* Query i has (5 i) mod (K + 1) neighbours, all different; query 1 also has
 * one beyond the distance limit. */
static kernel *new_kernel(void)
{
    kernel *const t = calloc(1, sizeof *t);
    uint32_t i, j;

    for (i = 0; i < M; i++) {
        t->count[i] = (i * 3 + 1) % (K + 1);
        for (j = 0; j < K; j++)
            t->index[i * K + j] = (i + 2 * j) % B;
    }
    random_reals(t->feature, B * F, 1, -1, 1);
    random_reals(t->source, B * 4, 2, -1, 1);
    random_reals(t->source_support, B * 4, 3, 0.4, 1);
    random_reals(t->query, M * 4, 4, -1, 1);
    random_reals(t->query_support, M * 4, 5, 0.4, 1);
    random_reals(t->d_out, M * F, 6, -1, 1);
    t->query[5] = 30;
    t->k = (saga_kernel){ M, B, F, K, t->index, t->count, 0.5, 0.75 };
    t->v = (saga_kernel_values){ t->feature, t->source, t->source_support,
                                 t->query, t->query_support };
    assert_int_equal(saga_kernel_link(&t->work, &t->k), 0);
    return t;
}

static void kernel_should_match_differences(void **state)
{
    static const char *const name[5] = { "feature", "source", "support",
                                         "query", "query support" };
    static const size_t size[5] = { B * F, B * 4, B * 4, M * 4, M * 4 };
    kernel *const t = new_kernel();
    real *const x[5] = { t->feature, t->source, t->source_support, t->query,
                         t->query_support };
    real d[5][M * F + B * F] = { { 0 } };
    saga_kernel_values grads = { d[0], d[1], d[2], d[3], d[4] };
    int i;

    (void)state;
    kernel_loss(t);
    saga_kernel_backward(&grads, &t->work, t->d_out, &t->v, &t->k);
    for (i = 0; i < 5; i++) {
        const double worst = worst_error(kernel_loss, t, x[i], d[i], size[i]);

        printf("  %-13s worst error %.1e\n", name[i], worst);
        assert_true(worst < TOLERANCE);
    }
    saga_kernel_free(&t->work);
    free(t);
}

static void kernel_should_match_the_definition(void **state)
{
    kernel *const t = new_kernel();
    size_t i, j, a, f;

    (void)state;
    kernel_loss(t);
    for (i = 0; i < M; i++)
        for (f = 0; f < F; f++) {
            double sum = 0, top = 0;

            for (j = 0; j < t->count[i]; j++) {
                const size_t b = t->index[i * K + j];
                double d = 0;

                for (a = 0; a < 4; a++)
                    d += (a == 3 ? 0.75 : 1) *
                         pow((t->query[4 * i + a] - t->source[4 * b + a]) /
                             (t->query_support[4 * i + a] +
                              t->source_support[4 * b + a]), 2);
                d = exp(-fmin(d, 16) / 0.5);
                sum += d;
                top += d * t->feature[b * F + f];
            }
            if (t->count[i] > 0)
                top /= sum;
            assert_true(fabs(t->out[i * F + f] - top) < 1e-12);
        }
    saga_kernel_free(&t->work);
    free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(embedding_should_match_differences),
        cmocka_unit_test(embedding_should_be_sine_and_cosine),
        cmocka_unit_test(kernel_should_match_differences),
        cmocka_unit_test(kernel_should_match_the_definition)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
