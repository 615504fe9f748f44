/* SPDX-License-Identifier: MIT
 *
 * The policy against the rules it came from, in which lambda weighed bits over
 * values of coarse features: 16 of them for each primitive. What a bit cost,
 * the step and the widths follow from that lambda on three captures; at the
 * lambda that makes a bit cost the same today they must be the same.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "policy.h"

#include <math.h>

typedef struct {
    uint32_t n_primitives;
    double n_pixels;             /* views x width x height x frames */
    double old_lambda, lambda;
} scene;

static const scene scenes[] = {
    { 5000, 8. * 320 * 180 * 24, 0.00035, 0.0484 },    /* the demo */
    { 5000, 8. * 320 * 180 * 24, 0.0009, 0.1244 },
    { 5000, 8. * 320 * 180 * 24, 0.0015, 0.2074 },
    { 5000, 8. * 320 * 180 * 24, 0.004, 0.553 },
    { 15000, 13. * 480 * 270 * 30, 0.0005, 0.1053 },   /* studio */
    { 10000, 4. * 360 * 632 * 100, 0.0005, 0.2844 },   /* person4 */
};

enum { N_SCENES = sizeof scenes / sizeof *scenes };

static void near(double x, double y, double part)
{
    assert_true(fabs(x - y) <= part * fabs(y));
}

static void policy_should_keep_what_three_captures_had(void **state)
{
    (void)state;
    for (int i = 0; i < N_SCENES; i++) {
        const scene *const s = &scenes[i];
        const double share = s->old_lambda / s->n_primitives;
        const saga_policy p = saga_policy_of(s->lambda, s->n_pixels,
                                             s->n_primitives, s->n_primitives);

        near(p.price.residual, share / 16, 0.001);
        near(p.price.start, 4 * share / 16, 0.001);
        near(p.price.weight, 1.5 * share / 16, 0.001);
        near(p.prim_step, fmin(6 * sqrt(s->old_lambda), 0.25), 0.001);
        assert_int_equal(p.width, share < 2e-7 ? 64 : share < 5e-7 ? 48 : 32);
        assert_int_equal(p.entropy_width, 8);
        assert_int_equal(p.features, 16);
        assert_false(p.bank_pays);
    }
    near(saga_policy_of(SAGA_DEFAULT_LAMBDA, scenes[0].n_pixels, 5000,
                        5000).price.residual, 0.0005 / 80000, 0.02);
}

/* L = D + lambda x bits / pixels: twice the pictures halve what a bit costs. */
static void policy_should_price_bits_per_pixel(void **state)
{
    const saga_policy one = saga_policy_of(0.5, 1e6, 1000, 1000);
    const saga_policy two = saga_policy_of(0.5, 2e6, 1000, 1000);
    const saga_policy dear = saga_policy_of(1, 2e6, 1000, 1000);

    (void)state;
    near(one.price.residual, 0.5e-6, 1e-12);
    near(two.price.residual, 0.25e-6, 1e-12);
    near(dear.price.residual, one.price.residual, 1e-12);
    near(dear.prim_step, one.prim_step, 1e-12);
    assert_true(saga_policy_of(0, 1e6, 1000, 1000).price.residual > 0);
}

/* Dearer bits: fewer units and longer steps, within their limits. */
static void policy_should_be_monotone(void **state)
{
    saga_policy last = saga_policy_of(0, 1e7, 5000, 5000);

    (void)state;
    assert_int_equal(last.width, 64);
    near(last.prim_step, 1 / 64., 1e-12);
    for (int i = -40; i < 20; i++) {
        const saga_policy p = saga_policy_of(exp2(i / 4.), 1e7, 5000, 5000);

        assert_true(p.width <= last.width);
        assert_true(p.prim_step >= last.prim_step);
        last = p;
    }
    assert_int_equal(last.width, 32);
    near(last.prim_step, 0.25, 1e-12);
}

static void policy_should_follow_counts(void **state)
{
    (void)state;
    assert_int_equal(saga_policy_of(1, 1e7, 20000, 19999).features, 24);
    assert_int_equal(saga_policy_of(1, 1e7, 20000, 20000).entropy_width, 16);
    assert_false(saga_policy_of(1, 1e7, 39999, 39999).bank_pays);
    assert_true(saga_policy_of(1, 1e7, 40000, 40000).bank_pays);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(policy_should_keep_what_three_captures_had),
        cmocka_unit_test(policy_should_price_bits_per_pixel),
        cmocka_unit_test(policy_should_be_monotone),
        cmocka_unit_test(policy_should_follow_counts)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
