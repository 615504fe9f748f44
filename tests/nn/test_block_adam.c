/* SPDX-License-Identifier: MIT
 *
 * Adam along the principal axes of each block is compared with plain Adam and
 * with the axes of a known covariance, and must be faster in a narrow valley
 * that lies across the coordinates.
 */
#include "block_adam.h"
#include "rng.h"
#include "testing.h"
#include "threads.h"

#include <omp.h>

enum { WIDTH = 8 };

/* The state of several blocks. */
typedef struct {
    float *x, *g;
    saga_block_adam b;
} blocks;

static float *reals(size_t n)
{
    return calloc(n, sizeof(float));
}

static blocks make(size_t n, float rate)
{
    blocks s = { reals(n * WIDTH), reals(n * WIDTH), { 0 } };

    s.b = (saga_block_adam){ s.x,   s.g,
                             NULL,  reals(saga_block_adam_size(n, WIDTH)),
                             n,     WIDTH,
                             WIDTH, rate };
    saga_block_adam_begin(&s.b);
    return s;
}

static void drop(blocks *s)
{
    free(s->x);
    free(s->g);
    free(s->b.state);
}

/* Until the axes of a block are first computed, its steps must equal those of
 * plain Adam. This happens for block i in the first step k with k + i a
 * multiple of 50, which is not among the first nine steps for i % 50 < 40. One
 * gradient of 30 times the usual size shows that the bound is Adam's, too. */
TEST(blocks_should_step_as_adam_before_they_turn)
{
    enum { N = 1700, STEPS = 9 };
    const saga_adam adam = saga_adam_default();
    const saga_rng r = saga_rng_stream(7, 1);
    FREED_BY(drop) blocks s = make(N, 0.01f);
    float *const x = reals(N * WIDTH), *const m = reals(N * WIDTH);
    FREED float *const v = reals(N * WIDTH);
    const saga_adam_tensor t = { "x", x, s.g, m, v, N * WIDTH, 0.01f };

    for (uint64_t step = 1; step <= STEPS; step++) {
        for (size_t i = 0; i < N * WIDTH; i++)
            s.g[i] = (float)saga_rng_normal(r, step * N * WIDTH + i) *
                     (step == STEPS ? 30 : 1);
        assert_done(saga_adam_update(&adam, &t, 1, step, &error));
        saga_block_adam_update(&s.b, &adam, step);
    }
    for (size_t i = 0; i < N * WIDTH; i++)
        assert_true(i / WIDTH % SAGA_BLOCK_TURN_EVERY >= 40 ||
                    fabs((double)(x[i] - s.x[i])) < 1e-6);
    free(x);
    free(m);
}

/* Blocks of 5 of 11 numbers must take the steps of blocks of 8 whose last three
 * have no gradient, and leave all other numbers as they are. They turn twice in
 * the steps. */
TEST(blocks_should_be_a_part_of_their_rows)
{
    enum { N = 30, ROW = 11, FIRST = 4, HAS = 5, STEPS = 120 };
    const saga_adam adam = saga_adam_default();
    const saga_rng r = saga_rng_stream(7, 2);
    FREED_BY(drop) blocks whole = make(N, 0.01f);
    FREED_BY(drop) blocks part = make(N, 0.01f);
    saga_block_span span[N];
    float x[N * ROW], g[N * ROW];

    for (size_t i = 0; i < N; i++)
        span[i] = (saga_block_span){ FIRST, HAS };
    for (size_t i = 0; i < N * ROW; i++)
        x[i] = 7;
    for (size_t i = 0; i < N * WIDTH; i++)
        whole.x[i] = 7;
    part.b.x = x;
    part.b.g = g;
    part.b.span = span;
    part.b.stride = ROW;
    for (uint64_t step = 1; step <= STEPS; step++) {
        for (size_t i = 0; i < N * ROW; i++)
            g[i] = (float)saga_rng_normal(r, step * N * ROW + i);
        for (size_t i = 0; i < N; i++)
            memcpy(whole.g + i * WIDTH, g + i * ROW + FIRST, HAS * sizeof *g);
        saga_block_adam_update(&whole.b, &adam, step);
        saga_block_adam_update(&part.b, &adam, step);
    }
    for (size_t i = 0; i < N * ROW; i++) {
        const size_t k = i % ROW;

        assert_true(x[i] == (k >= FIRST && k < FIRST + HAS
                                 ? whole.x[i / ROW * WIDTH + k - FIRST]
                                 : 7));
    }
}

/* Sets q to a rotation: turns by these angles in planes of neighbours. */
static void rotate(double q[WIDTH][WIDTH])
{
    for (size_t i = 0; i < WIDTH; i++)
        for (size_t k = 0; k < WIDTH; k++)
            q[i][k] = i == k;
    for (size_t turn = 0; turn < 3 * WIDTH; turn++) {
        const size_t a = turn % WIDTH, b = (turn + 1 + turn / WIDTH) % WIDTH;
        const double angle = 0.4 + 0.1 * (double)turn;

        for (size_t k = 0; k < WIDTH; k++) {
            const double u = q[a][k], w = q[b][k];

            q[a][k] = cos(angle) * u - sin(angle) * w;
            q[b][k] = sin(angle) * u + cos(angle) * w;
        }
    }
}

/* Returns number l of axis k of block 0. */
static double axis(const blocks *s, size_t k, size_t l)
{
    return (double)s->b.state[(k * WIDTH + l) * SAGA_BLOCK_LANES];
}

/* Gradients have deviations 1, 2, 4, .. 128 along known axes. Each axis found
 * must be one of them, within the uncertainty of 200 gradients, and the axes
 * must stay orthonormal when they are computed 80 times. */
TEST(axes_should_be_those_of_the_gradients)
{
    enum { STEPS = 4000 };
    const saga_adam adam = saga_adam_default();
    const saga_rng r = saga_rng_stream(7, 2);
    double q[WIDTH][WIDTH];
    FREED_BY(drop) blocks s = make(1, 0);

    rotate(q);
    for (uint64_t step = 1; step <= STEPS; step++) {
        double g[WIDTH] = { 0 };

        for (size_t i = 0; i < WIDTH; i++) {
            const double z = ldexp(saga_rng_normal(r, step * WIDTH + i),
                                   (int)i);

            for (size_t k = 0; k < WIDTH; k++)
                g[k] += z * q[i][k];
        }
        for (size_t k = 0; k < WIDTH; k++)
            s.g[k] = (float)g[k];
        saga_block_adam_update(&s.b, &adam, step);
    }
    for (size_t i = 0; i < WIDTH; i++) {
        double best = 0;

        for (size_t k = 0; k < WIDTH; k++) {
            double along = 0, dot = 0;

            for (size_t l = 0; l < WIDTH; l++) {
                along += axis(&s, i, l) * q[k][l];
                dot += axis(&s, i, l) * axis(&s, k, l);
            }
            best = fmax(best, fabs(along));
            assert_true(fabs(dot - (i == k)) < 1e-5);
        }
        assert_true(best > 0.98);
    }
}

/* Minimises L = (u^2 + 10^4 w^2) / 2 in rotated coordinates, with noise as
 * large as the gradient, and returns what remains of u. Plain Adam is slow
 * along u, the floor of this valley, because each coordinate has large
 * gradients of w. */
static double floor_left(bool own_axes)
{
    enum { STEPS = 1500 };
    const saga_adam adam = saga_adam_default();
    const saga_rng r = saga_rng_stream(7, 3);
    FREED_BY(drop) blocks s = make(1, 0.002f);
    float m[WIDTH] = { 0 }, v[WIDTH] = { 0 };
    const saga_adam_tensor t = { "x", s.x, s.g, m, v, WIDTH, 0.002f };
    double q[WIDTH][WIDTH], u = 0;

    rotate(q);
    for (size_t k = 0; k < WIDTH; k++)
        s.x[k] = (float)(2 * q[0][k]);
    for (uint64_t step = 1; step <= STEPS; step++) {
        double g[WIDTH] = { 0 };

        for (size_t i = 0; i < WIDTH; i++) {
            const double steep = i ? 1e4 : 1;
            double at = 0.01 * saga_rng_normal(r, step * WIDTH + i);

            for (size_t k = 0; k < WIDTH; k++)
                at += (double)s.x[k] * q[i][k];
            for (size_t k = 0; k < WIDTH; k++)
                g[k] += steep * at * q[i][k];
        }
        for (size_t k = 0; k < WIDTH; k++)
            s.g[k] = (float)g[k];
        if (own_axes)
            saga_block_adam_update(&s.b, &adam, step);
        else
            assert_done(saga_adam_update(&adam, &t, 1, step, &error));
    }
    for (size_t k = 0; k < WIDTH; k++)
        u += (double)s.x[k] * q[0][k];
    return fabs(u);
}

TEST(blocks_should_walk_along_a_valley)
{
    const double own = floor_left(true), adam = floor_left(false);

    printf("  valley: %.3f of 2 are left, Adam leaves %.3f\n", own, adam);
    assert_true(own < 0.5 && adam > 1.5);
}

/* The blocks beside a block, which share its vectors, change nothing either. */
TEST(blocks_should_not_depend_on_threads_or_other_blocks)
{
    enum { N = 860, MORE = 900, STEPS = 60 };
    const saga_adam adam = saga_adam_default();
    const saga_rng r = saga_rng_stream(7, 4);
    blocks s[2];

    saga_set_least_work(0);
    for (int k = 0; k < 2; k++) {
        const size_t n = k ? MORE : N;

        omp_set_num_threads(k ? 3 : 1);
        s[k] = make(n, 0.01f);
        for (uint64_t step = 1; step <= STEPS; step++) {
            for (size_t i = 0; i < n * WIDTH; i++)
                s[k].g[i] = saga_rng_float(r, step * MORE * WIDTH + i) - 0.4f;
            saga_block_adam_update(&s[k].b, &adam, step);
        }
    }
    assert_memory_equal(s[0].x, s[1].x, N * WIDTH * sizeof(float));
    /* The groups of the first 800 blocks have no others. */
    assert_memory_equal(s[0].b.state, s[1].b.state,
                        saga_block_adam_size(800, WIDTH) * sizeof(float));
    drop(&s[0]);
    drop(&s[1]);
}
