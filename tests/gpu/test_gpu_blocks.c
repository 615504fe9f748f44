/* SPDX-License-Identifier: MIT
 *
 * The optimiser of blocks on a device against the host's, from the same state
 * and with the same gradients. SAGA_TEST_GPU is the number of the device; the
 * first one is the default. Without a device the tests are skipped.
 */
#include "gpu_blocks.h"
#include "rng.h"
#include "test_device.h"

TEST_GROUP(set_up_device, tear_down_device);

/* --- Blocks -------------------------------------------------------------- */

/* A number of blocks of `width`, of which each has all, or a part of its row.
 */
typedef struct {
    size_t n, width, stride;
    bool is_part;
} shape;

static size_t n_state(const shape *s)
{
    return saga_block_adam_size(s->n, s->width);
}

static saga_block_adam make(const shape *s)
{
    const saga_rng r = saga_rng_stream(5, 1);
    saga_block_span *const span = zeroed(s->n, sizeof *span);
    real *const x = zeroed(s->n * s->stride, sizeof *x);
    const saga_block_adam b = { .x = x,
                                .g = zeroed(s->n * s->stride, sizeof *x),
                                .span = s->is_part ? span : NULL,
                                .state = aligned_alloc(64, 4 * n_state(s)),
                                .n = s->n,
                                .width = s->width,
                                .stride = s->stride,
                                .rate = R(0.01) };

    for (size_t i = 0; i < s->n; i++)
        span[i] = (saga_block_span){ (uint8_t)(i % 3),
                                     (uint8_t)(s->width - i % 2) };
    for (size_t i = 0; i < s->n * s->stride; i++)
        x[i] = saga_rng_float(r, i);
    saga_block_adam_begin(&b);
    if (!s->is_part)
        free(span);
    return b;
}

static void drop(saga_block_adam *b)
{
    free(b->x);
    free((void *)(uintptr_t)b->g);
    free((void *)(uintptr_t)b->span);
    free(b->state);
}

/* Sets the gradients of a step: correlated, and of sizes from 1 to 2^-7. */
static void set_gradients(const saga_block_adam *b, uint64_t step)
{
    const saga_rng r = saga_rng_stream(5, 2);
    real *const g = (real *)(uintptr_t)b->g;
    const size_t n = b->n * b->stride;

    for (size_t i = 0; i < n; i++)
        g[i] = (saga_rng_float(r, step * n + i) - R(0.5)) / R(1 << i % 8);
    for (size_t i = 0; i < n; i += b->stride)
        for (size_t k = 1; k < b->stride; k++)
            g[i + k] += R(0.5) * g[i + k - 1];
}

static void copy(const saga_block_adam *to, const saga_block_adam *from,
                 const shape *s)
{
    memcpy(to->x, from->x, s->n * s->stride * sizeof *to->x);
    memcpy(to->state, from->state, n_state(s) * sizeof *to->state);
}

/* Does steps first .. last - 1, on the device if there is `on`. */
static void do_steps(const saga_block_adam *b, saga_gpu_blocks *on,
                     uint64_t first, uint64_t last)
{
    const saga_adam adam = saga_adam_default();

    for (uint64_t step = first; step < last; step++) {
        set_gradients(b, step);
        if (on)
            assert_done(saga_gpu_blocks_step(on, b, &adam, step, &error));
        else
            saga_block_adam_update(b, &adam, step);
    }
}

/* Returns the largest difference of two numbers, over the longest way from
 * `start`. */
static double difference(const real *x, const real *y, const real *start,
                         size_t n)
{
    double worst = 0, most = 0;

    for (size_t i = 0; i < n; i++) {
        const double off = fabs((double)(x[i] - y[i]));

        worst = fmax(worst, isfinite(off) ? off : INFINITY);
        most = fmax(most, fabs((double)(y[i] - start[i])));
    }
    assert_true(most > 0);
    return worst / most;
}

/* --- Tests --------------------------------------------------------------- */

/* Before a block turns it steps as on the host, but for roundings: in the first
 * nine steps those with i % 50 < 40. Later the axes are compared from a state
 * in which each block has had more gradients than it has numbers: before, some
 * of the covariance's eigenvalues are 0 but for roundings, which then choose
 * the axes. */
TEST(blocks_should_step_as_on_the_host)
{
    /* The device counts blocks in spans of 50 x 16, so that one shape has more
     * than 800. */
    static const shape list[] = { { 1, 4, 4, false },
                                  { 850, 4, 5, true },
                                  { 110, 8, 8, false },
                                  { 170, 16, 19, true },
                                  { 13, 64, 66, true } };
    saga_gpu *const gpu = test_device_of(state);

    for (size_t c = 0; c < sizeof list / sizeof list[0]; c++) {
        const shape *const s = &list[c];
        const size_t n = s->n * s->stride;
        const uint64_t later = testing_long() ? 2000 : 150;
        FREED_BY(drop) saga_block_adam host = make(s);
        FREED_BY(drop) saga_block_adam there = make(s);
        real *const start = zeroed(n, sizeof *start);
        saga_gpu_blocks *on;
        double early = 0, late;

        assert_done(on = saga_gpu_blocks_new(gpu, &error));
        memcpy(start, host.x, n * sizeof *start);
        assert_done(saga_gpu_blocks_put(on, &there, &error));
        do_steps(&there, on, 1, 10);
        do_steps(&host, NULL, 1, 10);
        for (size_t i = 0; i < s->n; i++)
            if (i % SAGA_BLOCK_TURN_EVERY < 40)
                early = fmax(early,
                             difference(there.x + i * s->stride,
                                        host.x + i * s->stride,
                                        start + i * s->stride, s->stride));
        do_steps(&host, NULL, 10, later);
        copy(&there, &host, s);
        memcpy(start, host.x, n * sizeof *start);
        assert_done(saga_gpu_blocks_put(on, &there, &error));
        do_steps(&there, on, later, later + 60);
        do_steps(&host, NULL, later, later + 60);
        late = difference(there.x, host.x, start, n);
        print_message("%zu of %zu: %g early, %g late\n", s->n, s->width, early,
                      late);
        assert_true(early < 1e-5);
        assert_true(late < 1e-4);
        saga_gpu_blocks_free(on);
        free(start);
    }
}

/* A training may go on elsewhere: the state that comes back must be the one
 * that went, and the host must go on from the device's as the device does. */
TEST(a_state_should_move_between_device_and_host)
{
    const shape s = { 120, 12, 12, false };
    const size_t n = s.n * s.stride;
    saga_gpu *const gpu = test_device_of(state);
    FREED_BY(drop) saga_block_adam b = make(&s);
    FREED_BY(drop) saga_block_adam back = make(&s);
    FREED real *const start = zeroed(n, sizeof *start);
    saga_gpu_blocks *on;

    do_steps(&b, NULL, 1, 150);
    assert_done(on = saga_gpu_blocks_new(gpu, &error));
    assert_done(saga_gpu_blocks_put(on, &b, &error));
    assert_done(saga_gpu_blocks_get(on, &back, &error));
    assert_memory_equal(back.state, b.state, n_state(&s) * sizeof *b.state);
    do_steps(&b, on, 150, 210);
    assert_done(saga_gpu_blocks_get(on, &back, &error));
    memcpy(back.x, b.x, n * sizeof *start);
    memcpy(start, b.x, n * sizeof *start);
    do_steps(&b, on, 210, 270);
    do_steps(&back, NULL, 210, 270);
    assert_true(difference(back.x, b.x, start, n) < 1e-4);
    saga_gpu_blocks_free(on);
}

TEST(two_runs_should_give_the_same_bits)
{
    const shape s = { 120, 16, 16, false };
    saga_gpu *const gpu = test_device_of(state);
    saga_block_adam b[2];

    for (int k = 0; k < 2; k++) {
        saga_gpu_blocks *on;

        b[k] = make(&s);
        assert_done(on = saga_gpu_blocks_new(gpu, &error));
        assert_done(saga_gpu_blocks_put(on, &b[k], &error));
        do_steps(&b[k], on, 1, 60);
        assert_done(saga_gpu_blocks_get(on, &b[k], &error));
        saga_gpu_blocks_free(on);
    }
    assert_memory_equal(b[0].x, b[1].x, s.n * s.stride * sizeof *b->x);
    assert_memory_equal(b[0].state, b[1].state, n_state(&s) * sizeof *b->x);
    drop(&b[0]);
    drop(&b[1]);
}

TEST(a_gradient_that_is_not_finite_should_be_an_error)
{
    const shape s = { 20, 8, 8, false };
    const saga_adam adam = saga_adam_default();
    saga_gpu *const gpu = test_device_of(state);
    FREED_BY(drop) saga_block_adam b = make(&s);
    FREED_BY(drop) saga_block_adam before = make(&s);
    saga_error e = { "" };
    saga_gpu_blocks *on;

    assert_done(on = saga_gpu_blocks_new(gpu, &error));
    assert_done(saga_gpu_blocks_put(on, &b, &error));
    set_gradients(&b, 1);
    ((real *)(uintptr_t)b.g)[77] = R(INFINITY);
    assert_false(saga_gpu_blocks_step(on, &b, &adam, 1, &e));
    assert_non_null(strstr(e.message, "not finite at step 1"));
    assert_memory_equal(b.x, before.x, s.n * s.stride * sizeof *b.x);
    saga_gpu_blocks_free(on);
}
