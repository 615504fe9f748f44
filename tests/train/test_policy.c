/* SPDX-License-Identifier: MIT
 *
 * The policy: bits are priced per pixel, steps and widths follow the price, and
 * lambda follows the error of the warm-up. Learning rates follow the length of
 * a film.
 */
#include "fit_state.h"
#include "policy.h"
#include "testing.h"

static void near(double x, double y, double part)
{
    assert_true(fabs(x - y) <= part * fabs(y));
}

/* The loss is 255^2 D + lambda bits / pixels. With twice as many pictures a bit
 * must have half the price. */
TEST(policy_should_price_bits_per_pixel)
{
    const saga_policy one = saga_policy_of(0.5, 1e6, 1000);
    const saga_policy two = saga_policy_of(0.5, 2e6, 1000);
    const saga_policy dear = saga_policy_of(1, 2e6, 1000);

    near(one.price.residual, 0.5e-6 / 65025, 1e-12);
    near(two.price.residual, 0.25e-6 / 65025, 1e-12);
    near(dear.price.residual, one.price.residual, 1e-12);
    near(dear.prim_step, one.prim_step, 1e-12);
    near(one.price.start, 4 * one.price.residual, 1e-12);
    near(one.price.weight, 1.5 * one.price.residual, 1e-12);
    assert_true(saga_policy_of(0, 1e6, 1000).price.residual > 0);
}

/* With twice as many primitives, or half the error, a bit has half the price.
 */
TEST(lambda_should_balance_primitives_and_bits)
{
    const double lambda = saga_policy_lambda(1e-4, 1e7, 5000);

    near(saga_policy_lambda(1e-4, 1e7, 10000), lambda / 2, 1e-12);
    near(saga_policy_lambda(0.5e-4, 1e7, 5000), lambda / 2, 1e-12);
    near(saga_policy_lambda(1e-4, 2e7, 5000), lambda * 2, 1e-12);
}

/* saga_policy_primitives must be the inverse of saga_policy_lambda: for the
 * number of primitives that it returns, and the error that the power law gives
 * for this number, the balancing lambda is the given one. */
TEST(primitives_should_balance_lambda)
{
    const double lambda = saga_policy_lambda(1e-4, 1e7, 5000);

    near(saga_policy_primitives(lambda, 1e-4, 1e7, 5000), 5000, 1e-9);
    for (double times = 0.1; times < 20; times *= 3) {
        const double n = saga_policy_primitives(times * lambda, 1e-4, 1e7,
                                                5000);
        const double mse = 1e-4 * pow(n / 5000, -0.43);

        near(saga_policy_lambda(mse, 1e7, 1) / n, times * lambda, 1e-9);
    }
}

/* If bits are more expensive, there are fewer hidden units and longer steps,
 * within their limits. */
TEST(policy_should_be_monotone)
{
    saga_policy last = saga_policy_of(0, 1e7, 5000);

    assert_int_equal(last.width, 64);
    near(last.prim_step, 1 / 64., 1e-12);
    for (int i = -40; i < 20; i++) {
        const saga_policy p = saga_policy_of(exp2(i / 2. + 4), 1e7, 5000);

        assert_true(p.width <= last.width);
        assert_true(p.prim_step >= last.prim_step);
        last = p;
    }
    assert_int_equal(last.width, 32);
    near(last.prim_step, 0.5, 1e-12);
}

TEST(policy_should_follow_counts)
{
    assert_int_equal(saga_policy_of(1, 1e7, 20000).entropy_width, 16);
}

/* Returns the rates in the middle of a fit to a film of three views. */
static saga_fit_rates rates_of(int frames, uint32_t tools)
{
    const saga_pictures pictures = { .n_train = 3, .n_there = 3 * frames };
    saga_scene scene = { .model.tools = tools };
    const saga_fit fit = { .scene = &scene,
                           .pictures = &pictures,
                           .o.n_render = 9600,
                           .iteration = 2400 };

    return saga_fit_rates_now(&fit);
}

/* In a film of four times the frames a quarter of the pictures shows what lives
 * briefly, and Adam moves its features twice as far at each of them: they must
 * have half of the rate. Weights, which each picture moves, keep theirs, as do
 * films of up to 32 frames and what stands still. */
TEST(features_should_learn_slower_in_a_longer_film)
{
    const saga_fit_rates one = rates_of(32, SAGA_TOOL_OPACITY_T);
    const saga_fit_rates four = rates_of(128, SAGA_TOOL_OPACITY_T);
    const saga_fit_rates sixteen = rates_of(512, SAGA_TOOL_OPACITY_T);

    near((double)four.feature, (double)one.feature / 2, 1e-6);
    near((double)sixteen.feature, (double)one.feature / 4, 1e-6);
    near((double)four.networks, (double)one.networks, 0);
    near((double)four.prim, (double)one.prim, 0);
    near((double)rates_of(24, SAGA_TOOL_OPACITY_T).feature, (double)one.feature,
         0);
    near((double)rates_of(512, 0).feature, (double)one.feature, 0);
}
