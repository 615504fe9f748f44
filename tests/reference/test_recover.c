/* SPDX-License-Identifier: MIT
 *
 * Masked anchors lie on a line and have features that are known functions of
 * their position, so that the recovered features can be derived.
 */
#include "mask.h"
#include "recover.h"
#include "testing.h"

/* Cells of depth 8: 2^15 box units to a half-size. */
enum { N = 101, F = 2, DEPTH = 8, HALF = 1 << (23 - DEPTH) };

typedef struct {
    saga_model model;
    saga_scaffold sc;
    saga_coarse coarse[N];
    double was[N][F], now[N][F];
} line;

/* Makes anchors that are two half-sizes apart in x, so that neighbours have a
 * distance of 1 and the next ones of 4. Every other anchor is masked. */
static void make(line *l, uint32_t radius2)
{
    saga_tier *const tier = &l->model.tier[SAGA_TIER_COARSE];

    memset(l, 0, sizeof *l);
    l->model.features = F;
    tier->window = 16;
    tier->neighbours = 8;
    tier->radius2_q12 = (uint16_t)((radius2 << 12) + 1);
    tier->softmax_q8 = 369;
    l->sc.model = &l->model;
    l->sc.n.coarse = N;
    l->sc.coarse = l->coarse;
    for (int i = 0; i < N; i++) {
        l->coarse[i].x[0] = (2 * i - N) * HALF;
        l->coarse[i].depth_x = DEPTH;
        l->coarse[i].group = (uint8_t)(i % 2);
    }
}

static uint32_t recover(line *l, int how)
{
    memcpy(l->now, l->was, sizeof l->now);
    for (int i = 1; i < N; i += 2)
        l->now[i][0] = l->now[i][1] = NAN;
    return ref_recover(&l->now[0][0], &l->sc, SAGA_TIER_COARSE, how,
                       saga_rng_stream(1, 2));
}

/* Returns the rms error divided by the rms of the masked features; the known
 * features must be unchanged. */
static double error(const line *l)
{
    double wrong = 0, all = 0;

    for (int i = 0; i < N; i++)
        for (int k = 0; k < F; k++) {
            const double d = l->now[i][k] - l->was[i][k];

            if (i % 2) {
                wrong += d * d;
                all += l->was[i][k] * l->was[i][k];
            } else
                assert_true(d == 0);
        }
    return sqrt(wrong / all);
}

TEST(recover_should_give_a_constant_whatever_it_takes)
{
    static line l;

    make(&l, 4);
    for (int i = 0; i < N; i++) {
        l.was[i][0] = 3;
        l.was[i][1] = -0.25;
    }
    for (int how = 0; how < SAGA_N_RECOVERS; how++) {
        assert_int_equal(recover(&l, how), 0);
        assert_true(error(&l) < 1e-12);
    }
}

/* The two neighbours at a distance of 1 have equal weights, and no other anchor
 * is inside the radius, so that a linear feature must be recovered exactly. The
 * mean of all known anchors, 0, 2, .. 100, is the middle value, because the
 * masked ones are symmetric among them; its relative error must be 1. */
TEST(recover_should_find_a_linear_function_between_neighbours)
{
    static line l;

    make(&l, 2);
    for (int i = 0; i < N; i++) {
        l.was[i][0] = i - 50;
        l.was[i][1] = 2 * (50 - i);
    }
    assert_int_equal(recover(&l, SAGA_RECOVER_NEIGHBOURS), 0);
    assert_true(error(&l) < 1e-12);
    recover(&l, SAGA_RECOVER_MEAN);
    assert_true(fabs(error(&l) - 1) < 1e-12);
    recover(&l, SAGA_RECOVER_RANDOM);
    assert_true(error(&l) > 0.9);
}

/* Two halves are far from each other and have a feature of +1 and of -1.
 * Neighbours must recover it exactly. A pair of random anchors with equal
 * weights gives 1, 0 or -1, with errors of 0, 1, 2 in 1/4, 1/2, 1/4 of all
 * cases, so that the mean square is 1.5, with a standard deviation of 0.21 for
 * 50 masked anchors. */
TEST(recover_should_tell_halves_apart_by_neighbours_alone)
{
    static line l;

    make(&l, 2);
    for (int i = 0; i < N; i++) {
        l.was[i][0] = l.was[i][1] = i <= 50 ? 1 : -1;
        l.coarse[i].x[0] += i <= 50 ? 0 : 40 * HALF;
    }
    assert_int_equal(recover(&l, SAGA_RECOVER_NEIGHBOURS), 0);
    assert_true(error(&l) < 1e-12);
    recover(&l, SAGA_RECOVER_RANDOM);
    assert_true(error(&l) > 1 && error(&l) < sqrt(2));
}

/* With a radius below 1 no anchor has a neighbour. All must be counted as alone
 * and get the mean. */
TEST(recover_should_count_anchors_that_are_alone)
{
    static line l;

    make(&l, 2);
    l.model.tier[SAGA_TIER_COARSE].radius2_q12 = 4096;
    for (int i = 0; i < N; i++)
        l.was[i][0] = i - 50;
    assert_int_equal(recover(&l, SAGA_RECOVER_NEIGHBOURS), N / 2);
    assert_true(fabs(error(&l) - 1) < 1e-12);
}
