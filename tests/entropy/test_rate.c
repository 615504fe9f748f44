/* SPDX-License-Identifier: MIT
 *
 * The entropy model must keep exactly the sources that predict the values,
 * whether their networks were set by hand or trained. Values that were coded
 * must stay the same when they are coded again, in runs or all at once. The
 * cost of bits in float is compared with the cost in double.
 */
#include "adam.h"
#include "rate_bits.h"
#include "rate_choice.h"
#include "rate_row.h"
#include "rate_scene.h"
#include "testing.h"

#include <omp.h>

/* Makes networks that give their kinds' constants for any input. */
static void begin_as_constants(rate_scene *f)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };

    saga_rate_start(&f->r, &f->s, &x);
}

/* Makes a network pass an input through, times gain: one hidden unit has the
 * value, one its negative, in two layers, and the output their difference. */
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

/* Sets coarse features, in all channels, to 4 times the sine of half a turn
 * along x. */
static void foretell_by_place(rate_scene *f)
{
    const size_t n = f->s.model.features;

    for (size_t i = 0; i < f->s.n.coarse; i++)
        for (size_t k = 0; k < n; k++)
            f->s.coarse_feature[i * n + k] =
                (real)(4 * sin(1.5707963267948966 *
                               (double)f->r.context.kind[0].phase[4 * i]));
    begin_as_constants(f);
}

/* Makes networks predict these features from the hyperprior's first input. */
static void foretell(rate_scene *f)
{
    const size_t channels = saga_n_channels(&f->s.model, SAGA_KIND_COARSE);
    const size_t n = f->s.model.features;
    saga_net *const hyper = &f->s.net[SAGA_NET_HYPER];
    saga_net *const net = &f->s.net[SAGA_NET_E_COARSE];

    foretell_by_place(f);
    clear_net(hyper);
    pass_through(hyper, 0, 0, 1);
    /* Clear everything except the biases of the last layer. */
    memset(net->w[0], 0, (size_t)(net->b[2] - net->w[0]) * sizeof *net->w[0]);
    for (size_t k = 0; k < n; k++) {
        pass_through(net, 0, 4 + k,
                     4 / saga_rate_mu_unit(&f->s.model, SAGA_KIND_COARSE, 4));
        net->b[2][4 + k] = 0;
        net->b[2][channels + 4 + k] = -1;
    }
}

static void decide(rate_scene *f)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };

    assert_done(saga_rate_decide(&f->r, &f->s, &x, &error));
    assert_int_equal(f->r.decision.decided, 1);
}

/* Makes the scene with or without a bank. */
static void make_scene(rate_scene *f, uint32_t depth, uint32_t tools)
{
    saga_model m;

    rate_scene_model(&m);
    if (tools)
        rate_scene_bank(&m, tools);
    rate_scene_make(f, &m, depth);
}

static void should_have_no_memory(rate_scene *f)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };
    FREED_BY(saga_rate_choice_free) saga_rate_choice c;

    assert_done(saga_rate_choice_init(&c, &f->r, &x, &error));
    assert_true(f->r.decision.bank_net >= 0);
    assert_int_equal(c.scene.model.tools, SAGA_TOOLS_PICTURE);
    for (int net = SAGA_NET_QUERY; net < SAGA_N_NETS; net++)
        assert_int_equal(c.scene.net[net].n_layers, 0);
    assert_true(saga_model_is_valid(&c.scene.model));
}

static void should_drop_everything(uint32_t tools)
{
    FREED_BY(rate_scene_free) rate_scene f;

    make_scene(&f, 3, tools);
    begin_as_constants(&f);
    decide(&f);
    for (int kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_gain *const g = &f.r.decision.gain[kind];

        assert_int_equal(f.r.context.keep[kind], 0);
        /* Networks and constants give the same distribution, except for the
         * steps of the networks' formats. */
        assert_true(fabs(g->networks - g->constants) < 0.002 * g->constants);
        assert_true(g->weights <= 0);
    }
    assert_true(f.r.decision.hyper_weights <= 0);
    should_have_no_memory(&f);
}

TEST(decide_should_drop_what_foretells_nothing)
{
    should_drop_everything(0);
    should_drop_everything(SAGA_TOOL_BANK | SAGA_TOOL_PLAIN_WRITE);
}

TEST(decide_should_keep_what_foretells)
{
    FREED_BY(rate_scene_free) rate_scene f;
    const saga_rate_gain *g;

    rate_scene_init(&f, 3);
    foretell(&f);
    decide(&f);
    g = &f.r.decision.gain[SAGA_KIND_COARSE];
    printf("  coarse: %.0f bits with constants, %.0f with networks, chosen "
           "%.0f; weights %.0f and %.0f\n",
           g->constants, g->networks, g->chosen, g->weights,
           f.r.decision.hyper_weights);
    assert_int_equal(f.r.context.keep[SAGA_KIND_COARSE], SAGA_SOURCE_HYPER);
    assert_int_equal(f.r.context.keep[SAGA_KIND_FINE], 0);
    assert_int_equal(f.r.context.keep[SAGA_KIND_PRIM], 0);
    assert_true(g->chosen + g->weights + f.r.decision.hyper_weights <
                g->constants);
    assert_true(f.r.decision.hyper_weights > 0);
}

/* Trains everything for n steps, the bank in each. With rates four times as
 * high the result would depend on the last bits. */
static void learn(rate_scene *f, int n)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };
    const saga_adam adam = saga_adam_default();
    const size_t n_params = (size_t)(f->s.net[SAGA_NET_FUSE_C].w[0] -
                                     f->s.params);
    FREED real *const m = calloc(2 * n_params, sizeof *m);
    saga_adam_tensor t = { "networks",   f->s.params, f->d.params, m,
                           m + n_params, n_params,    0.005f };
    double bits[SAGA_N_STEPS];

    assert_non_null(m);
    f->o.remember = true;
    for (int i = 1; i <= n; i++) {
        memset(f->d.reals, 0, f->d.n_reals * sizeof *f->d.reals);
        saga_rate_add(bits, &f->r, &f->d, &x, &f->o);
        assert_done(saga_adam_update(&adam, &t, 1, (uint64_t)i, &error));
    }
}

/* The features depend on the position alone, and of all sources only the bank
 * knows the position, because a query contains it. A trained bank must be kept.
 */
TEST(decide_should_keep_a_bank_that_learned)
{
    const saga_rate_gain *g;
    FREED_BY(rate_scene_free) rate_scene f;
    saga_model m;

    rate_scene_model(&m);
    rate_scene_bank(&m, SAGA_TOOL_BANK);
    memset(m.sources, 0, sizeof m.sources);
    m.sources[SAGA_KIND_COARSE] = SAGA_SOURCE_BANK;
    rate_scene_make(&f, &m, 3);
    foretell_by_place(&f);
    learn(&f, 1200);
    decide(&f);
    g = &f.r.decision.gain[SAGA_KIND_COARSE];
    printf("  coarse: %.0f bits with constants, chosen %.0f; weights %.0f and "
           "%.0f, net %.0f\n",
           g->constants, g->chosen, g->weights, f.r.decision.bank_weights,
           f.r.decision.bank_net);
    assert_int_equal(f.r.context.keep[SAGA_KIND_COARSE], SAGA_SOURCE_BANK);
    assert_true(f.r.decision.bank_weights > 0);
    assert_true(g->chosen + g->weights + f.r.decision.bank_weights <
                g->constants);
    assert_true(f.r.decision.bank_net < 0);
}

static void copy_reads(real *to, const rate_scene *f)
{
    const saga_rate_context *const c = &f->r.context;

    for (int kind = 0; kind < SAGA_N_KINDS; kind++) {
        const size_t n = c->kind[kind].n_blocks * c->bank.width;

        memcpy(to, c->bank.kind[kind].read, n * sizeof *to);
        to += n;
    }
}

/* A round of the bank may depend only on what is coded before it. Therefore all
 * rounds computed at once, with everything decoded, must give what they gave
 * one by one. */
TEST(memory_should_be_causal)
{
    double bits[SAGA_N_STEPS] = { 0 };
    real *one, *all;
    FREED_BY(rate_scene_free) rate_scene f;
    size_t n;

    make_scene(&f, 2, SAGA_TOOL_BANK);
    n = (f.s.n.coarse + 2 * (size_t)f.s.n.fine) * f.s.model.bank_width;
    one = malloc(n * sizeof *one);
    all = malloc(n * sizeof *all);
    assert_true(one && all);
    {
        const saga_rate_input x = { &f.s, &f.w, f.s.coarse_feature };

        for (int kind = 0; kind < SAGA_N_KINDS; kind++)
            saga_rate_code(bits, &f.r, &x, kind);
        copy_reads(one, &f);
        for (int kind = 0; kind < SAGA_N_KINDS; kind++)
            saga_rate_all(&f.r, &x, kind);
        copy_reads(all, &f);
    }
    assert_memory_equal(one, all, n * sizeof *one);
    free(one);
    free(all);
}

/* If only columns of zeros are removed from the networks, the reduced networks
 * must give the same parameters, hence the same bytes. */
static void should_code_alike(uint32_t tools, const uint8_t keep[SAGA_N_KINDS])
{
    FREED_BY(rate_scene_free) rate_scene f;
    FREED_BY(saga_rate_choice_free) saga_rate_choice c;
    double bits[SAGA_N_STEPS] = { 0 };
    size_t n;
    FREED real *feature;

    make_scene(&f, 2, tools);
    foretell(&f);
    decide(&f);
    memcpy(f.r.context.keep, keep, SAGA_N_KINDS);
    n = f.s.n.coarse * (size_t)f.s.model.features;
    feature = copy_of(f.s.coarse_feature, n * sizeof *feature);
    {
        const saga_scene rounded = saga_rate_rounded(&f.r, &f.s);
        const saga_rate_input x = { &rounded, &f.w, feature };

        for (int kind = 0; kind < SAGA_N_KINDS; kind++)
            saga_rate_code(bits, &f.r, &x, kind);
    }
    {
        const saga_rate_input x = { &f.s, &f.w, feature };

        assert_done(saga_rate_choice_init(&c, &f.r, &x, &error));
        memcpy(feature, f.s.coarse_feature, n * sizeof *feature);
        saga_rate_choice_code(&c, &f.r, &x, SAGA_KIND_COARSE, SAGA_KIND_PRIM);
    }
    assert_true(saga_model_is_valid(&c.scene.model));
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        assert_int_equal(c.scene.model.sources[kind], keep[kind]);
    for (size_t i = 0; i < SAGA_N_STEPS; i++)
        assert_true(fabs(c.bits[i] - bits[i]) <= 1e-9 * bits[i]);
}

TEST(choice_should_code_as_the_rate_does)
{
    static const uint8_t without[SAGA_N_KINDS] = { SAGA_SOURCE_HYPER,
                                                   SAGA_SOURCE_GROUPS,
                                                   SAGA_SOURCE_PARENT };
    static const uint8_t with[SAGA_N_KINDS] = { SAGA_SOURCE_HYPER |
                                                    SAGA_SOURCE_BANK,
                                                SAGA_SOURCE_GROUPS,
                                                SAGA_SOURCE_BANK };

    should_code_alike(0, without);
    should_code_alike(SAGA_TOOL_BANK, without);
    should_code_alike(SAGA_TOOL_BANK, with);
}

/* Training must round features to the values that are decoded, even close to
 * the middle between two steps. The features here are a fifth of their format's
 * unit to both sides of it, and the means are 0.4 of a unit off the nearest
 * value of the format. */
TEST(features_should_be_rounded_as_they_are_coded)
{
    FREED_BY(rate_scene_free) rate_scene f;
    double bits[SAGA_N_STEPS] = { 0 };
    size_t n, wrong = 0;
    real *coded, *rounded;

    rate_scene_init(&f, 2);
    memset(f.r.context.keep, 0, SAGA_N_KINDS);
    f.r.decision.given = 1;
    n = f.s.model.features;
    for (size_t i = 0; i < n; i++)
        f.r.constants.mean[SAGA_KIND_COARSE][4 + i] = (real)ldexp(
            7 + 0.4 * (i % 2 ? 1 : -1), -f.s.model.out_q[SAGA_OUT_COARSE]);
    n *= f.s.n.coarse;
    coded = malloc(n * sizeof *coded);
    rounded = malloc(n * sizeof *rounded);
    assert_true(coded && rounded);
    for (size_t i = 0; i < n; i++) {
        const double step = f.s.model.step_q16[SAGA_STEP_FEATURE] / 65536.0;
        const double off = (double)(i % 9) - 3.5;

        coded[i] = f.s.coarse_feature[i] = (real)ldexp(
            7 + off * step + (i % 5 > 1 ? 0.2 : -0.2),
            -f.s.model.out_q[SAGA_OUT_COARSE]);
    }
    {
        const saga_rate_input x = { &f.s, &f.w, coded };

        saga_rate_start(&f.r, &f.s, &x);
        saga_rate_code(bits, &f.r, &x, SAGA_KIND_COARSE);
    }
    saga_rate_round(rounded, &f.r, &f.s, (saga_range){ 0, n });
    for (size_t i = 0; i < n; i++)
        wrong += fabs((double)(rounded[i] - coded[i])) > 1e-6;
    printf("  %zu of %zu differ\n", wrong, n);
    assert_int_equal(wrong, 0);
    free(coded);
    free(rounded);
}

/* --- Rows of costs ------------------------------------------------------- */

/* Chunks of rows must not write where others do, whatever source they are at.
 * If they did, some of the runs would differ. */
TEST(threads_should_give_the_same_bits)
{
    double first[SAGA_N_STEPS], bits[SAGA_N_STEPS];
    FREED_BY(rate_scene_free) rate_scene f;

    saga_set_least_work(0);
    omp_set_num_threads(4);
    rate_scene_init(&f, 3);
    for (int i = 0; i < 100; i++) {
        const saga_rate_input x = { &f.s, &f.w, f.s.coarse_feature };

        omp_set_num_threads(i ? 4 : 1);
        saga_rate_add(i ? bits : first, &f.r, &f.d, &x, &f.o);
        if (i)
            assert_memory_equal(bits, first, sizeof bits);
    }
    omp_set_num_threads(1);
}

static double off(real x, double want, double least)
{
    return fabs((double)x - want) / fmax(fabs(want), least);
}

/* The cost of a row of values is tested in whole vectors and in the rest after
 * them, with values far from the mean, and with deviations from 1/9 to 58
 * steps. */
TEST(rows_should_cost_what_their_values_do)
{
    double bits = 0, slope = 0, v, s;
    saga_rate_row r;
    size_t n = 0;

    for (s = SAGA_RATE_LOG2_MIN; s <= SAGA_RATE_LOG2_MAX; s += 0.031)
        for (v = -40000; v < 40000;
             v += fabs(v) < 8 ? 0.0371 : 1.73 + fabs(v) / 20) {
            r.v[n] = (real)v;
            r.log2_sigma[n] = (real)s;
            if (++n < 13)
                continue;
            saga_rate_cost_row(&r, n);
            for (size_t i = 0; i < n; i++) {
                const saga_rate_cost c = saga_rate_bits(
                    (double)r.v[i], (double)r.log2_sigma[i]);

                bits = fmax(bits, fabs((double)r.bits[i] - c.bits));
                slope = fmax(slope, off(r.d_v[i], c.d_v, 0.01));
                slope = fmax(slope,
                             off(r.d_log2_sigma[i], c.d_log2_sigma, 0.1));
            }
            n = 0;
        }
    printf("  %.2g bits, %.2g of a derivative\n", bits, slope);
    assert_true(bits < 1.2e-4);
    assert_true(slope < 2e-4);
}
