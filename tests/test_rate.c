/* SPDX-License-Identifier: MIT
 *
 * What is kept of an entropy model: sources that foretell, by construction, and
 * no others. And that coding what was coded changes nothing.
 */
#include "rate_choice.h"
#include "rate_scene.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>

/* Networks that give their kinds' constants whatever enters. */
static void begin_as_constants(rate_scene *f)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };

    saga_rate_start(&f->r, &f->s, &x);
}

/* One hidden unit for a value, one for its negative; two layers of them, then
 * their difference times gain. */
static void pass_through(saga_net *net, size_t input, size_t output, float gain)
{
    const size_t dim = (size_t)net->dim[1];

    net->w[0][input] = 1;
    net->w[0][(size_t)net->dim[0] + input] = -1;
    net->w[1][0] = 1;
    net->w[1][dim + 1] = 1;
    net->w[2][output * dim] = gain;
    net->w[2][output * dim + 1] = -gain;
}

static void clear_net(saga_net *net)
{
    memset(net->w[0], 0, saga_net_n_params(net) * sizeof *net->w[0]);
}

/* Coarse features become 4 times the sine of half a turn along x, in all
 * channels, and networks that say so from the hyperprior's first input. */
static void foretell(rate_scene *f)
{
    const size_t channels = saga_n_channels(&f->s.model, SAGA_KIND_COARSE);
    const size_t n = f->s.model.features;
    saga_net *const hyper = &f->s.net[SAGA_NET_HYPER];
    saga_net *const net = &f->s.net[SAGA_NET_E_COARSE];
    size_t i, k;

    for (i = 0; i < f->s.n.coarse; i++)
        for (k = 0; k < n; k++)
            f->s.coarse_feature[i * n + k] = (real)(
                4 * sin(1.5707963267948966 *
                        (double)f->r.context.kind[0].phase[4 * i]));
    begin_as_constants(f);
    clear_net(hyper);
    pass_through(hyper, 0, 0, 1);
    /* All but the last layer's biases. */
    memset(net->w[0], 0, (size_t)(net->b[2] - net->w[0]) *
           sizeof *net->w[0]);
    for (k = 0; k < n; k++) {
        pass_through(net, 0, 4 + k,
                     4 / saga_rate_mu_unit(&f->s.model, SAGA_KIND_COARSE, 4));
        net->b[2][4 + k] = 0;
        net->b[2][channels + 4 + k] = -1;
    }
}

static void decide(rate_scene *f)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };

    assert_int_equal(saga_rate_decide(&f->r, &f->s, &x), 0);
    assert_int_equal(f->r.plan.decided, 1);
}

static void decide_should_drop_what_foretells_nothing(void **state)
{
    rate_scene f;
    int kind;

    (void)state;
    rate_scene_init(&f, 3);
    begin_as_constants(&f);
    decide(&f);
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_gain *const g = &f.r.plan.gain[kind];

        assert_int_equal(f.r.context.keep[kind], 0);
        /* The same distribution but for the steps of networks' formats. */
        assert_true(fabs(g->networks - g->constants) < 0.002 * g->constants);
        assert_true(g->weights <= 0);
    }
    assert_true(f.r.plan.hyper_weights <= 0);
    rate_scene_free(&f);
}

static void decide_should_keep_what_foretells(void **state)
{
    rate_scene f;
    const saga_rate_gain *g;

    (void)state;
    rate_scene_init(&f, 3);
    foretell(&f);
    decide(&f);
    g = &f.r.plan.gain[SAGA_KIND_COARSE];
    printf("  coarse: %.0f bits with constants, %.0f with networks, chosen "
           "%.0f; weights %.0f and %.0f\n", g->constants, g->networks,
           g->chosen, g->weights, f.r.plan.hyper_weights);
    assert_int_equal(f.r.context.keep[SAGA_KIND_COARSE], SAGA_SOURCE_HYPER);
    assert_int_equal(f.r.context.keep[SAGA_KIND_FINE], 0);
    assert_int_equal(f.r.context.keep[SAGA_KIND_PRIM], 0);
    assert_true(g->chosen + g->weights + f.r.plan.hyper_weights <
                g->constants);
    assert_true(f.r.plan.hyper_weights > 0);
    rate_scene_free(&f);
}

/* Where nothing is left out but columns of zeros, the reduced networks give
 * the same parameters and so the same code. */
static void choice_should_code_as_the_rate_does(void **state)
{
    rate_scene f;
    saga_rate_choice c;
    double bits[SAGA_N_STEPS] = { 0 };
    size_t n, i;
    real *feature;
    int kind;

    (void)state;
    rate_scene_init(&f, 2);
    foretell(&f);
    decide(&f);
    f.r.context.keep[SAGA_KIND_COARSE] = SAGA_SOURCE_HYPER;
    f.r.context.keep[SAGA_KIND_FINE] = SAGA_SOURCE_GROUPS;
    f.r.context.keep[SAGA_KIND_PRIM] = SAGA_SOURCE_PARENT;
    n = f.s.n.coarse * (size_t)f.s.model.features;
    feature = malloc(n * sizeof *feature);
    assert_non_null(feature);
    memcpy(feature, f.s.coarse_feature, n * sizeof *feature);
    {
        const saga_scene rounded = saga_rate_rounded(&f.r, &f.s);
        const saga_rate_input x = { &rounded, &f.w, feature };

        for (kind = 0; kind < SAGA_N_KINDS; kind++)
            assert_int_equal(saga_rate_code(bits, &f.r, &x, kind), 0);
    }
    {
        const saga_rate_input x = { &f.s, &f.w, feature };

        assert_int_equal(saga_rate_choice_init(&c, &f.r, &x), 0);
        memcpy(feature, f.s.coarse_feature, n * sizeof *feature);
        assert_int_equal(saga_rate_choice_code(&c, &f.r, &x, SAGA_KIND_COARSE,
                                               SAGA_KIND_PRIM), 0);
    }
    assert_int_equal(c.scene.net[SAGA_NET_E_FINE].dim[0], f.s.model.features);
    for (i = 0; i < SAGA_N_STEPS; i++)
        assert_true(fabs(c.bits[i] - bits[i]) <= 1e-9 * bits[i]);
    saga_rate_choice_free(&c);
    free(feature);
    rate_scene_free(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(decide_should_drop_what_foretells_nothing),
        cmocka_unit_test(decide_should_keep_what_foretells),
        cmocka_unit_test(choice_should_code_as_the_rate_does)
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
