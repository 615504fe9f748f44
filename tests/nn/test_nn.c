/* SPDX-License-Identifier: MIT
 *
 * Parts of the trainer's networks in float: Adam against steps computed by
 * hand, random numbers, and the same bits for any number of threads.
 */
#include "adam.h"
#include "embedding.h"
#include "net.h"
#include "noise.h"
#include "rng.h"
#include "testing.h"

#include <omp.h>

/* --- Adam ---------------------------------------------------------------- */

/* In the first step m' = g and v' = g^2, so that x must move by the rate,
 * against the sign of g. In the second step, with g = 3 after g = 1,
 * m' = (0.09 + 0.3) / 0.19 and v' = (0.000999 + 0.009) / 0.001999. */
TEST(adam_should_match_steps_by_hand)
{
    enum { N = 13 };
    const saga_adam adam = saga_adam_default();
    float x[N], g[N], m[N] = { 0 }, v[N] = { 0 };
    const saga_adam_tensor t = { "x", x, g, m, v, N, 0.5f };

    for (int i = 0; i < N; i++) {
        x[i] = 2;
        g[i] = i % 2 ? -1e-12f : 1;
    }
    assert_done(saga_adam_update(&adam, &t, 1, 1, &error));
    for (int i = 0; i < N; i++) {
        /* |g| = 1e-12 is 1000 times eps. */
        const double want = i % 2 ? 2 + 0.5 / 1.001 : 1.5;

        assert_true(fabs((double)x[i] - want) < 1e-6);
        assert_true(fabs((double)m[i] - 0.1 * (double)g[i]) <
                    1e-7 * fabs((double)g[i]));
    }
    for (int i = 0; i < N; i++)
        g[i] = 3;
    assert_done(saga_adam_update(&adam, &t, 1, 2, &error));
    for (int i = 0; i < N; i += 2)
        assert_true(fabs((double)x[i] - (1.5 - 0.5 * (0.39 / 0.19) /
                                                   sqrt(0.009999 / 0.001999))) <
                    1e-5);
}

/* Without a bound, steps must equal those of Kingma and Ba's algorithm 1, which
 * is computed in double here. */
TEST(adam_should_be_adam)
{
    enum { N = 13, STEPS = 20 };
    const saga_adam adam = { 0.9f, 0.995f, 1e-15f, 15 };
    const saga_rng r = saga_rng_stream(3, 4);
    float x[N] = { 0 }, m[N] = { 0 }, v[N] = { 0 }, g[N];
    double rx[N] = { 0 }, rm[N] = { 0 }, rv[N] = { 0 };
    const saga_adam_tensor tensor = { "x", x, g, m, v, N, 0.01f };

    for (int t = 1; t <= STEPS; t++) {
        for (int i = 0; i < N; i++) {
            g[i] = saga_rng_float(r, (uint64_t)(t * N + i)) - 0.3f;
            rm[i] = 0.9 * rm[i] + 0.1 * (double)g[i];
            rv[i] = 0.995 * rv[i] + 0.005 * (double)g[i] * (double)g[i];
            rx[i] -= 0.01 * (rm[i] / (1 - pow(0.9, t))) /
                     (sqrt(rv[i] / (1 - pow(0.995, t))) + 1e-15);
        }
        assert_done(saga_adam_update(&adam, &tensor, 1, (uint64_t)t, &error));
    }
    for (int i = 0; i < N; i++)
        assert_true(fabs((double)x[i] - rx[i]) < 1e-6);
}

/* After gradients of +-1, for which m = 0 and v = 1, there is one gradient of
 * 1,000, which makes sqrt(v') 31.6, and then gradients of 0. Without a bound x
 * moves by 3.16 rates in the first step and by 0.9^k of that k steps later, 31
 * rates in all. With the bound the first step must be 0.1 `most` rates. */
TEST(adam_should_bound_what_is_out_of_the_ordinary)
{
    const saga_adam adam = saga_adam_default();
    float x = 0, g = 1000, m = 0, v = 1;
    const saga_adam_tensor t = { "x", &x, &g, &m, &v, 1, 0.5f };
    const double first = 0.5 * 0.1 * (double)adam.most;

    assert_done(saga_adam_update(&adam, &t, 1, 1000000, &error));
    assert_true(fabs((double)x + first) < 1e-4 * first);
    g = 0;
    for (int i = 1; i < 200; i++)
        assert_done(saga_adam_update(&adam, &t, 1, 1000000, &error));
    /* v' falls by 0.001 a step meanwhile, which adds less than half a per
     * cent. */
    assert_true(fabs((double)x + 10 * first) < 0.005 * 10 * first);
}

TEST(adam_should_name_what_is_not_finite)
{
    enum { N = 10000 };
    const saga_adam adam = saga_adam_default();
    FREED float *const x = calloc(8 * N, sizeof *x);
    const saga_adam_tensor t[2] = {
        { "good", x, x + N, x + 2 * N, x + 3 * N, N, 1 },
        { "bad", x + 4 * N, x + 5 * N, x + 6 * N, x + 7 * N, N - 1, 1 }
    };
    saga_error error = { "" };

    for (int i = 0; i < N; i++)
        x[N + i] = x[5 * N + i] = 1;
    x[5 * N + 9997] = NAN;
    x[5 * N + 4321] = INFINITY;
    assert_false(saga_adam_update(&adam, t, 2, 7, &error));
    assert_non_null(strstr(error.message, "number 4321 of the gradients of "
                                          "the bad is not finite at step 7"));
    assert_true(x[0] == 0);
    x[5 * N + 9997] = x[5 * N + 4321] = 1;
    x[4 * N + 9998] = -INFINITY;
    error = (saga_error){ "" };
    assert_false(saga_adam_update(&adam, t, 2, 1, &error));
    assert_non_null(strstr(error.message, "number 9998 of the values"));
    x[4 * N + 9998] = 0;
    assert_true(saga_adam_update(&adam, t, 2, 1, &error));
    assert_true(x[0] < 0 && x[4 * N + 9998] < 0);
}

/* --- Random numbers ------------------------------------------------------ */

TEST(rng_should_have_the_right_moments)
{
    enum { N = 200000 };
    const saga_rng r = saga_rng_stream(1, 2);
    double mean = 0, square = 0, normal = 0, normal2 = 0, lag = 0;
    int count[7] = { 0 };

    for (uint64_t i = 0; i < N; i++) {
        const double u = saga_rng_double(r, i) - 0.5;
        const double z = saga_rng_normal(r, i);

        mean += u;
        square += u * u;
        lag += u * (saga_rng_double(r, i + 1) - 0.5);
        normal += z;
        normal2 += z * z;
        count[saga_rng_below(r, i, 7)]++;
        assert_true(saga_rng_float(r, i) >= 0 && saga_rng_float(r, i) < 1);
    }
    assert_true(fabs(mean / N) < 0.003);
    assert_true(fabs(square / N - 1.0 / 12) < 0.001);
    assert_true(fabs(lag / N) < 0.001);
    assert_true(fabs(normal / N) < 0.01);
    assert_true(fabs(normal2 / N - 1) < 0.02);
    for (uint64_t i = 0; i < 7; i++)
        assert_true(abs(count[i] - N / 7) < 800);
}

TEST(rng_should_have_unrelated_streams)
{
    uint64_t same = 0;

    for (uint64_t s = 0; s < 200; s++)
        for (uint64_t i = 0; i < 200; i++)
            same += (saga_rng_bits(saga_rng_stream(1, s), i) >> 48) ==
                    (saga_rng_bits(saga_rng_stream(1, s + 1), i) >> 48);
    assert_true(same < 10);
    assert_true(saga_rng_bits(saga_rng_stream(1, 2), 3) !=
                saga_rng_bits(saga_rng_stream(2, 1), 3));
}

/* Every epoch must contain each number once, and the orders of two epochs must
 * differ. The mean difference between neighbours must be that of a random
 * order, n / 3, within four standard deviations of n / sqrt(18 n). */
TEST(rng_should_shuffle_each_epoch_anew)
{
    enum { MOST = 2000, EPOCHS = 3 };
    static uint8_t seen[MOST];

    for (uint32_t n = 1; n <= MOST; n += n < 70 ? 1 : 193) {
        const saga_rng r = saga_rng_stream(7, n);
        uint32_t same = 0;

        for (uint32_t epoch = 0; epoch < EPOCHS; epoch++) {
            double step = 0;
            uint32_t before = 0;

            memset(seen, 0, n);
            for (uint32_t i = 0; i < n; i++) {
                const uint32_t x = saga_rng_shuffled(r, (uint64_t)epoch * n + i,
                                                     n);

                assert_true(x < n && !seen[x]);
                seen[x] = 1;
                step += i ? fabs((double)x - before) : 0;
                before = x;
                same += epoch && x == saga_rng_shuffled(r, i, n);
            }
            if (n > 100)
                assert_true(fabs(step / n - n / 3.0) < 4 * n / sqrt(18.0 * n));
        }
        if (n > 100)
            assert_true(same < 20);
    }
}

/* --- Threads ------------------------------------------------------------- */

enum { POINTS = 2345 };

static const saga_net shape = { .n_layers = 3, .dim = { 27, 32, 16, 5 } };

typedef struct {
    float x[POINTS * 27], dx[POINTS * 27], y[POINTS * 5], dy[POINTS * 5];
    float w[2000], dw[2000];
} batch;

static void run_batch(batch *e)
{
    saga_net net = shape, d = shape;
    FREED_BY(saga_net_free) saga_net_work work;

    assert_done(saga_net_reserve(&work, &net, POINTS, &error));
    saga_net_bind(&net, e->w);
    saga_net_bind(&d, e->dw);
    assert_true(saga_net_n_params(&net) <= 2000);
    memset(e->dw, 0, sizeof e->dw);
    saga_net_forward(e->y, &work, e->x, POINTS, &net);
    saga_net_backward(e->dx, &d, &work, e->dy, e->x, POINTS, &net);
}

static void fill(float *x, size_t n, uint64_t stream, float lo, float hi)
{
    for (size_t i = 0; i < n; i++)
        x[i] = lo + (hi - lo) * saga_rng_float(saga_rng_stream(9, stream), i);
}

TEST(nets_should_not_depend_on_threads)
{
    FREED batch *const e = calloc(2, sizeof *e);

    fill(e->x, POINTS * 27, 1, -1, 1);
    fill(e->dy, POINTS * 5, 2, -1, 1);
    fill(e->w, 2000, 3, -0.3f, 0.3f);
    saga_set_least_work(0);
    for (int threads = 1; threads <= 3; threads++) {
        omp_set_num_threads(threads);
        run_batch(e);
        if (threads == 1)
            memcpy(e + 1, e, sizeof *e);
        assert_memory_equal(e, e + 1, sizeof *e);
    }
}

/* The phase is reduced exactly in float, so that the embedding must be as
 * accurate near a phase of 8 turns as near 0. */
TEST(embedding_should_be_precise_in_float)
{
    double worst = 0;
    float u;

    for (u = -2; u < 2; u += 0.00731f) {
        float y[8];

        saga_embedding_forward(y, 8, &u, 1, 1, 4);
        for (int k = 0; k < 4; k++) {
            const double angle = acos(-1) / 2 * (1 << k) * (double)u;

            worst = fmax(worst, fabs((double)y[2 * k] - sin(angle)));
            worst = fmax(worst, fabs((double)y[2 * k + 1] - cos(angle)));
        }
    }
    printf("  embedding: float error %.1e\n", worst);
    assert_true(worst < 2e-7);
}

/* Points with one octave are embedded several at a time. Each must be as if it
 * were embedded alone, coordinate by coordinate. */
TEST(embedding_should_be_the_same_in_whole_vectors)
{
    enum { FEW = 7, STRIDE = 11 };
    const saga_rng r = saga_rng_stream(5, 2);
    float u[4 * FEW], y[FEW * STRIDE], one[2];

    for (size_t i = 0; i < 4 * FEW; i++)
        u[i] = 4 * saga_rng_float(r, i) - 2;
    saga_embedding_forward(y, STRIDE, u, FEW, 4, 1);
    for (size_t i = 0; i < 4 * FEW; i++) {
        saga_embedding_forward(one, 2, u + i, 1, 1, 1);
        assert_memory_equal(one, y + i / 4 * STRIDE + i % 4 * 2, sizeof one);
    }
}

/* Noise is computed in vectors, and must be that of single random numbers. */
TEST(noise_should_be_that_of_the_stream)
{
    enum { N = 1003, FIRST = 5 };
    const saga_rng r = saga_rng_stream(5, 3);
    float x[N], y[N];

    for (size_t i = 0; i < N; i++)
        x[i] = y[i] = saga_rng_float(r, i) - 0.5f;
    saga_noise_add(y, x, 0.0625, r, (saga_range){ FIRST, N });
    for (size_t i = FIRST; i < N; i++)
        x[i] = (float)((double)x[i] + 0.0625 * (saga_rng_double(r, i) - 0.5));
    assert_memory_equal(x, y, sizeof x);
}
