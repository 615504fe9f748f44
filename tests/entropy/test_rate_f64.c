/* SPDX-License-Identifier: MIT
 *
 * The differentiable rate in double. A residual's cost is compared with the
 * coder's integer frequencies, its derivative with differences. Gradients of a
 * scene's bits with respect to values, contexts and networks are compared with
 * central differences.
 */
#include "cost.h"
#include "rate_bits.h"
#include "rate_scene.h"
#include "testing.h"

/* --- One residual -------------------------------------------------------- */

static double log2_sigma_of(int index)
{
    return (index - SAGA_SCALE_UNIT) / (double)SAGA_SCALE_PER_OCTAVE;
}

/* The cost of a residual is compared with the coder's code length. If the
 * symbol's integer frequency is at least 200, rounding changes the probability
 * by a factor of at most 200.5 / 200. Rarer symbols have a frequency of at
 * least 1, and the length of the escape code bounds the cost from above. */
TEST(bits_should_be_near_the_coders)
{
    double worst = 0;

    for (int index = 0; index < SAGA_N_SCALES; index++)
        for (int q = 0; q < 3000; q = q < 300 ? q + 1 : q + 97) {
            const double want = saga_cost_residual(q, (uint32_t)index);
            const double bits = saga_rate_bits(q, log2_sigma_of(index)).bits;

            if (want < SAGA_PROB_BITS - log2(200))
                worst = fmax(worst, fabs(bits - want));
            assert_true(bits <= 1e-9 + 21 + log2(1 + q * q / 64.0));
        }
    printf("  at most %.4f bits from likely symbols\n", worst);
    assert_true(worst < 0.025);
}

TEST(escapes_should_cost_at_least_what_they_do)
{
    /* At scale 0 every |q| > 1 is an escape. */
    for (uint32_t q = 2; q <= SAGA_MAX_RESIDUAL; q += 1 + q / 50)
        assert_true(saga_rate_bits(q, log2_sigma_of(0)).bits >=
                    saga_cost_residual((int32_t)q, 0));
}

TEST(bits_should_have_their_derivatives)
{
    const double h = 1e-6;
    double v, s;

    for (v = -300; v < 300; v += fabs(v) < 12 ? 0.173 : 7.1)
        for (s = SAGA_RATE_LOG2_MIN + 0.01; s < SAGA_RATE_LOG2_MAX; s += 0.57) {
            const saga_rate_cost c = saga_rate_bits(v, s);
            const double dv = (saga_rate_bits(v + h, s).bits -
                               saga_rate_bits(v - h, s).bits) /
                              (2 * h);
            const double ds = (saga_rate_bits(v, s + h).bits -
                               saga_rate_bits(v, s - h).bits) /
                              (2 * h);

            assert_true(isfinite(c.bits) && c.bits >= -1e-5);
            assert_true(fabs(c.d_v - dv) < 1e-6 * (1 + fabs(dv)) + 1e-7);
            assert_true(fabs(c.d_log2_sigma - ds) <
                        1e-6 * (1 + fabs(ds)) + 1e-7);
        }
}

/* --- A scene's bits ------------------------------------------------------ */

/* Returns weight times all bits; adds the gradients to d. */
static double loss(rate_scene *f, saga_scene *d)
{
    const saga_rate_input x = { &f->s, &f->w, f->s.coarse_feature };
    double bits[SAGA_N_STEPS];

    saga_rate_add(bits, &f->r, d, &x, &f->o);
    return f->o.weight * (bits[0] + bits[1] + bits[2] + bits[3]);
}

static double rms(const real *x, size_t n)
{
    double sum = 0;

    for (size_t i = 0; i < n; i++)
        sum += x[i] * x[i];
    return sqrt(sum / (double)n);
}

/* Compares gradients with central differences with a step of 1e-6. A difference
 * may be 2e-5 of the gradient plus 2e-5 of the root mean square of all
 * gradients, plus 1e-7 for the rounding of a loss of some hundred. One in a
 * hundred may differ more, because a ReLU may change its state within the step.
 * Under sanitizers only one in seven gradients is tested. */
static void check_range(rate_scene *f, const char *what, real *x, const real *g,
                        size_t n)
{
    const double h = 1e-6, unit = fmin(1, rms(g, n));
    saga_scene probe;
    const size_t every = testing_sanitized() ? 7 : 1;
    size_t wrong = 0, alive = 0;

    assert_done(saga_scene_init(&probe, &f->s.model, f->s.n, 1, 0, &error));
    for (size_t i = 0; i < n; i += every) {
        const double keep = x[i];
        double up, down, want;

        x[i] = keep + h;
        saga_twin_offsets(&f->w, &f->s);
        up = loss(f, &probe);
        x[i] = keep - h;
        saga_twin_offsets(&f->w, &f->s);
        down = loss(f, &probe);
        x[i] = keep;
        want = (up - down) / (2 * h);
        alive += fabs(want) > 1e-6;
        wrong += fabs(want - g[i]) > 2e-5 * (unit + fabs(want)) + 1e-7;
    }
    n = (n + every - 1) / every;
    printf("  %s: %zu of %zu differ, %zu are not 0\n", what, wrong, n, alive);
    saga_scene_free(&probe);
    assert_true(wrong * 100 <= n);
    assert_true(alive * 4 > n);
}

/* Checks the gradients of supports: a wider support makes the offsets of its
 * primitives smaller. The sizes that the entropy networks read are held
 * constant. */
static void check_supports(rate_scene *f, const real *d_log2_support)
{
    const size_t n = 4 * (size_t)f->s.n.fine;
    FREED real *const d = malloc(n * sizeof *d);

    assert_non_null(d);
    for (size_t i = 0; i < n; i++)
        d[i] = d_log2_support[i] / (f->w.support[i] * M_LN2);
    check_range(f, "supports", f->w.support, d, n);
}

/* Checks all gradients. tools: those of the bank, or SAGA_TOOL_CLASSES. */
static void check_gradients(uint8_t keep, uint32_t tools)
{
    FREED_BY(rate_scene_free) rate_scene f;
    saga_model m;
    real *d_fine, *d_support;
    size_t n_fine, n_support, n_params;

    rate_scene_model(&m);
    if (tools == SAGA_TOOL_CLASSES)
        rate_scene_classes(&m);
    else if (tools)
        rate_scene_bank(&m, tools);
    rate_scene_make(&f, &m, 1);
    f.o.remember = true;
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        f.r.context.keep[kind] = keep;
    n_fine = f.s.n.fine * (size_t)f.s.model.features;
    n_support = 4 * (size_t)f.s.n.fine;
    n_params = saga_rate_n_params(&f.s);
    loss(&f, &f.d);
    d_fine = copy_of(f.w.d_fine_feature, n_fine * sizeof *d_fine);
    d_support = copy_of(f.w.d_log2_support, n_support * sizeof *d_support);
    check_range(&f, "primitive positions", f.s.prim_x, f.d.prim_x,
                4 * (size_t)f.s.n.prim);
    check_supports(&f, d_support);
    check_range(&f, "coarse features", f.s.coarse_feature, f.d.coarse_feature,
                f.s.n.coarse * (size_t)f.s.model.features);
    check_range(&f, "fine features", f.w.fine_feature, d_fine, n_fine);
    check_range(&f, "networks", f.s.params, f.d.params, n_params);
    for (int i = SAGA_NET_QUERY; i <= SAGA_NET_WRITE && m.bank_slots; i++)
        check_range(&f, "a network of the memory", f.s.net[i].w[0],
                    f.d.net[i].w[0], saga_net_n_params(&f.s.net[i]));
    free(d_support);
    free(d_fine);
}

TEST(rate_gradients_should_match_differences)
{
    check_gradients(SAGA_SOURCE_HYPER | SAGA_SOURCE_PARENT | SAGA_SOURCE_GROUPS,
                    0);
    check_gradients(SAGA_SOURCE_PARENT | SAGA_SOURCE_GROUPS, 0);
}

/* Features that an anchor's class lacks cost nothing, but networks may read
 * them. */
TEST(gradients_of_classes_should_match_differences)
{
    check_gradients(SAGA_SOURCES_KNOWN, SAGA_TOOL_CLASSES);
    check_gradients(SAGA_SOURCE_PARENT | SAGA_SOURCE_GROUPS, SAGA_TOOL_CLASSES);
}

/* Gradients must flow through the memory bank and all its updates, orthogonal
 * or plain. */
TEST(memory_gradients_should_match_differences)
{
    check_gradients(SAGA_SOURCES_KNOWN, SAGA_TOOL_BANK);
    check_gradients(SAGA_SOURCE_BANK, SAGA_TOOL_BANK | SAGA_TOOL_PLAIN_WRITE);
}

/* The bits of the four quarters of the blocks must add up to those of all. */
TEST(subsets_should_add_up)
{
    FREED_BY(rate_scene_free) rate_scene f;
    double all, sum = 0;
    FREED real *whole;

    rate_scene_init(&f, 1);
    all = loss(&f, &f.d);
    whole = copy_of(f.d.reals, f.d.n_reals * sizeof *whole);
    memset(f.d.reals, 0, f.d.n_reals * sizeof *f.d.reals);
    f.o.every = 4;
    for (f.o.first = 0; f.o.first < 4; f.o.first++)
        sum += loss(&f, &f.d) / 4;
    assert_true(fabs(sum - all) < 1e-9 * all);
    for (size_t i = 0; i < f.d.n_reals; i++)
        assert_true(fabs(f.d.reals[i] / 4 - whole[i]) <
                    1e-9 * (1 + fabs(whole[i])));
}
