/* SPDX-License-Identifier: MIT
 *
 * A trained file is taken apart. Put together again with its own networks, its
 * values must give its bytes. With refitted networks they must decode to within
 * half a step, and with all sources off cost the code length of constant
 * parameters. A source that contains the features must be found useful. The
 * order-0 coder is compared with sums computed by hand.
 */
#include "capture.h"
#include "encode.h"
#include "gen_order0.h"
#include "gen_refit.h"
#include "gen_stream.h"
#include "prob.h"
#include "quantise.h"
#include "ref_recorder.h"
#include "testing.h"
#include "tiny_training.h"

#include <unistd.h>

#ifdef _OPENMP
#include <omp.h>
#endif

enum { ITERATIONS = 150, N_CAMERAS = 4 };

typedef struct {
    uint8_t *bytes;
    size_t n;
    ref_file f;
    saga_naming names[N_CAMERAS]; /* names of the cameras, which ref_file
                                   * leaves out */
} fixture;

/* --- Fixture: a file of 500 primitives ----------------------------------- */

static int set_up(void **state)
{
    fixture *const f = calloc(1, sizeof *f);
    const saga_synth_options s = synth_options(64, 36, N_CAMERAS, 3, 300);
    const saga_train_options o = tiny_options(500, 20, 20);
    saga_capture c = tiny_capture(&s);
    trained r = tiny_train(&c, &o);

    assert_non_null(f);
    f->bytes = r.bytes;
    f->n = r.n;
    for (int i = 0; i < N_CAMERAS; i++)
        memcpy(f->names[i].name, c.views[i].name, sizeof c.views[i].name);
    saga_capture_free(&c);
    assert_null(ref_file_read(&f->f, f->bytes, f->n));
    *state = f;
    return 0;
}

static int tear_down(void **state)
{
    fixture *const f = *state;

    ref_file_free(&f->f);
    free(f->bytes);
    free(f);
    return 0;
}

/* --- Apart and together -------------------------------------------------- */

/* Encodes the file's values, networks and names into a new file. */
static void encode_again(uint8_t **bytes, size_t *n, const ref_file *f,
                         const saga_naming *names)
{
    const saga_targets t = { .value = (const int16_t *const *)f->value };
    saga_encode_sizes sizes;
    saga_quantise_report report;
    saga_error error = { "" };
    saga_symbols y = f->s;
    saga_encoder *const e = saga_encoder_open(&f->h, f->rig, &f->nets, &error);

    assert_non_null(e);
    assert_true(saga_encoder_names(e, names, &error));
    assert_true(saga_quantise_segment(&y, &report, e, &t, NULL, &error));
    assert_true(saga_encoder_segment(e, &y, f->segment.n_frames, &error));
    assert_true(saga_encoder_finish(e, bytes, n, &sizes, &error));
    for (int i = 0; i < SAGA_N_SYMS; i++)
        assert_true(fabs(sizes.bits[i] - f->bits[i]) < 1e-6);
    saga_encoder_free(e);
}

TEST_OF(const fixture, file_should_come_back_from_its_values)
{
    double networks[SAGA_N_COMPONENTS], sum = 0;
    uint8_t *bytes;
    size_t n;

    encode_again(&bytes, &n, &f->f, f->names);
    assert_int_equal(n, f->n);
    assert_memory_equal(bytes, f->bytes, n);
    free(bytes);
    saga_cost_components(networks, f->f.bits);
    for (int i = 0; i < SAGA_N_NETS; i++)
        sum += f->f.net_bits[i];
    assert_true(fabs(sum - networks[SAGA_COMPONENT_NETWORKS]) < 1e-6);
}

TEST_OF(fixture, broken_file_should_be_refused)
{
    ref_file g;

    f->bytes[f->n - 1] ^= 1;
    assert_non_null(ref_file_read(&g, f->bytes, f->n));
    f->bytes[f->n - 1] ^= 1;
    for (size_t n = 0; n < f->n; n += f->n / 16)
        assert_non_null(ref_file_read(&g, f->bytes, n));
}

/* --- Fitted anew --------------------------------------------------------- */

static void refit(ref_file *out, refit_report *r, const ref_file *in,
                  const saga_ablation *ablation)
{
    refit_options o = refit_defaults();
    uint8_t *bytes = NULL;
    size_t n = 0;

    o.iterations = ITERATIONS;
    o.ablation = *ablation;
    assert_null(refit_make(&bytes, &n, r, in, &o));
    assert_null(ref_file_read(out, bytes, n));
    free(bytes);
}

static double all_bits(const ref_file *f)
{
    double sum = 0;

    for (int i = 0; i < SAGA_N_SYMS; i++)
        sum += f->bits[i];
    return sum;
}

/* Checks that values differ, in the channel's LSB, by at most half a step and
 * half an LSB for each rounding. */
static void values_should_be_within_half_a_step(const ref_file *a,
                                                const ref_file *b)
{
    for (int step = 0; step < SAGA_N_STEPS; step++) {
        const double half = a->h.model.step_q16[step] / 131072.0 + 1;
        const size_t n = (size_t)ref_file_rows(a, step) *
                         ref_file_channels(a, step);

        assert_int_equal(ref_file_rows(a, step), ref_file_rows(b, step));
        for (size_t i = 0; i < n; i++)
            assert_true(abs(a->value[step][i] - b->value[step][i]) <= half);
    }
}

static void what_is_kept_should_be_the_same(const ref_file *a,
                                            const ref_file *b)
{
    assert_int_equal(a->s.n_nodes, b->s.n_nodes);
    assert_memory_equal(a->s.split, b->s.split, a->s.n_nodes);
    assert_memory_equal(a->s.n_fine, b->s.n_fine, a->s.n.coarse);
    assert_memory_equal(a->s.n_prim, b->s.n_prim, a->s.n.fine);
    assert_memory_equal(a->s.fine_suffix, b->s.fine_suffix,
                        a->s.n.fine * sizeof *a->s.fine_suffix);
    assert_memory_equal(a->s.prim_suffix, b->s.prim_suffix,
                        a->s.n.prim * sizeof *a->s.prim_suffix);
    for (int net = 0; net < SAGA_N_NETS; net++)
        for (int l = 0; l < a->shapes.shape[net].n_layers; l++) {
            const uint16_t *const dim = a->shapes.shape[net].dim + l;

            if (!saga_is_entropy_net(net))
                assert_memory_equal(a->nets.layer[net][l].weight,
                                    b->nets.layer[net][l].weight,
                                    dim[0] * dim[1] * sizeof(int32_t));
        }
}

/* The sources of the trainer are used; the result must be at most 1 % larger.
 */
TEST_OF(const fixture, refit_should_give_the_same_scene)
{
    const saga_ablation all = { .groups = 0 };
    refit_report r;
    FREED_BY(ref_file_free) ref_file g;

    refit(&g, &r, &f->f, &all);
    values_should_be_within_half_a_step(&f->f, &g);
    what_is_kept_should_be_the_same(&f->f, &g);
    assert_true(all_bits(&g) <= 1.01 * all_bits(&f->f));
}

/* A recorder_watch for a file without sources. Every block of a kind must have
 * the same mu and scale. For features, mu must be the mean of the channel, and
 * the scale must not exceed its deviation. */
typedef struct {
    const ref_file *f; /* before */
    int16_t mu[SAGA_N_SYMS][SAGA_MAX_FEATURES];
    uint8_t scale[SAGA_N_SYMS][SAGA_MAX_FEATURES];
    bool seen[SAGA_N_SYMS];
} constants;

static void one_for_all(void *user, const saga_scaffold *sc, saga_at at,
                        const int16_t *mu, const uint8_t *scale, uint32_t n)
{
    constants *const c = user;

    (void)sc;
    for (uint32_t i = 0; i < n; i++) {
        if (!c->seen[at.sym]) {
            c->mu[at.sym][i] = mu[i];
            c->scale[at.sym][i] = scale[i];
        }
        assert_int_equal(mu[i], c->mu[at.sym][i]);
        assert_int_equal(scale[i], c->scale[at.sym][i]);
    }
    c->seen[at.sym] = true;
}

static void features_should_have_constants(const constants *c)
{
    const uint32_t features = c->f->h.model.features, n = c->f->s.n.coarse;
    const int16_t *const v = c->f->value[SAGA_STEP_FEATURE];
    const double step = c->f->h.model.step_q16[SAGA_STEP_FEATURE] / 65536.0;

    for (uint32_t k = 0; k < features; k++) {
        double sum = 0, square = 0, log2_sigma;
        int scale;

        for (uint32_t i = 0; i < n; i++)
            sum += v[i * features + k] / (double)n;
        for (uint32_t i = 0; i < n; i++)
            square += pow(v[i * features + k] - sum, 2) / n;
        log2_sigma = 0.5 * log2(square / (step * step) + 1.0 / 12);
        scale = saga_prob_index((int16_t)lrint(1024 * log2_sigma), 10);
        assert_true(fabs(c->mu[SAGA_SYM_FEATURE][k] - sum) <= 0.51);
        /* The scale of a channel that hardly varies may be below the deviation
         * that rounding causes. */
        assert_in_range(c->scale[SAGA_SYM_FEATURE][k],
                        square > step * step / 12 ? scale - 7 : 0, scale + 1);
    }
}

TEST_OF(const fixture, refit_without_anything_should_have_constants)
{
    const saga_ablation none = {
        .no_hyper = 1, .no_parent = 1, .no_bank = 1, .groups = 1
    };
    refit_options o = refit_defaults();
    constants c = { .f = &f->f };
    uint8_t *bytes = NULL;
    refit_report r;
    size_t n = 0;

    o.iterations = 3;
    o.ablation = none;
    assert_null(refit_make(&bytes, &n, &r, &f->f, &o));
    assert_true(recorder_compare(one_for_all, &c, bytes, n));
    features_should_have_constants(&c);
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        assert_int_equal(r.sources[kind], 0);
    free(bytes);
}

/* Features are +12 or -12 steps, depending on the half of the cube. Constants
 * need log2(12 sqrt(2 pi e)) = 5.6 bits for each, a source that knows the
 * position 2. This source must be kept. */
TEST_OF(const fixture, refit_should_find_a_source_that_tells)
{
    const saga_ablation all = { .groups = 0 };
    const uint32_t features = f->f.h.model.features;
    const size_t n = (size_t)f->f.s.n.coarse * features;
    const double step = f->f.h.model.step_q16[SAGA_STEP_FEATURE] / 65536.0;
    int16_t *const kept = f->f.value[SAGA_STEP_FEATURE];
    FREED int16_t *const told = malloc(n * sizeof *told);
    ref_file in = f->f, g;
    refit_report r;

    assert_non_null(told);
    for (size_t i = 0; i < n; i++)
        told[i] = (int16_t)((in.sc.coarse[i / features].x[0] < 0 ? -12 : 12) *
                                step +
                            fmod(kept[i], step));
    in.value[SAGA_STEP_FEATURE] = told;
    refit(&g, &r, &in, &all);
    values_should_be_within_half_a_step(&in, &g);
    assert_int_not_equal(r.sources[SAGA_KIND_COARSE], 0);
    assert_true(g.bits[SAGA_SYM_FEATURE] < 4 * (double)n);
    assert_true(r.decision.gain[SAGA_KIND_COARSE].constants > 5 * (double)n);
    ref_file_free(&g);
}

static void refit_should_take(gen_stream *g)
{
    const saga_ablation all = { .groups = 0 };
    refit_options fast = refit_defaults();
    uint8_t *bytes, *again = NULL;
    refit_report r;
    ref_file f, h;
    size_t n;

    fast.iterations = 6;
    fast.ablation = all;
    gen_stream_encode(g, &bytes, &n);
    assert_null(ref_file_read(&f, bytes, n));
    assert_null(refit_make(&again, &n, &r, &f, &fast));
    assert_null(ref_file_read(&h, again, n));
    what_is_kept_should_be_the_same(&f, &h);
    ref_file_free(&h);
    ref_file_free(&f);
    free(again);
    free(bytes);
}

/* The networks of random streams do not predict their values. Such streams,
 * with a bank or without, must be read and refitted to another valid file. */
TEST(refit_should_take_any_stream)
{
    for (uint64_t seed = 1; seed <= 12; seed++) {
        const gen_options o = { .seed = seed,
                                .level = 3,
                                .n_coarse = 20,
                                .n_segments = 1,
                                .bank = (int)(seed % 3) };
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

        refit_should_take(&g);
    }
}

/* If a scene has no fine anchors, there is no residual of theirs from which the
 * choice of sources could take a mean input. It must do without. */
TEST(refit_should_take_a_scene_of_coarse_anchors_alone)
{
    for (int bank = 0; bank < 3; bank++) {
        const gen_options o = {
            .seed = 8, .level = 3, .n_coarse = 20, .n_segments = 1, .bank = bank
        };
        FREED_BY(gen_stream_free) gen_stream g;
        saga_symbols *const s = &g.segment[0];

        g = gen_stream_make(&o);
        memset(s->n_fine, 0, s->n.coarse);
        s->n.fine = s->n.prim = 0;
        refit_should_take(&g);
    }
}

TEST_OF(const fixture, refit_should_not_depend_on_threads)
{
    refit_options o = refit_defaults();
    uint8_t *bytes[2] = { NULL, NULL };
    refit_report r;
    size_t n[2] = { 0, 0 };

    o.iterations = 20;
    for (int i = 0; i < 2; i++) {
#ifdef _OPENMP
        saga_set_least_work(0);
        omp_set_num_threads(1 + 2 * i);
#endif
        assert_null(refit_make(&bytes[i], &n[i], &r, &f->f, &o));
    }
#ifdef _OPENMP
    omp_set_num_threads(omp_get_num_procs());
    saga_set_least_work(SAGA_LEAST_WORK);
#endif
    assert_int_equal(n[0], n[1]);
    assert_memory_equal(bytes[0], bytes[1], n[0]);
    free(bytes[0]);
    free(bytes[1]);
}

/* --- The order-0 coder --------------------------------------------------- */

/* The adaptive probability of the symbols 0, 0, 1 is 1/2 * 3/4 * 1/6 = 2^-4,
 * and the bounds take 32 bits. Their entropy is 3 log2(3) - 2. */
TEST(order0_should_be_the_sum_by_hand)
{
    const int32_t v[] = { 0, 9, 0, 9, 1, 9 };
    order0_row row = { 0 };

    order0_channel(&row, v, 2, 3);
    assert_int_equal(row.n, 3);
    assert_true(fabs(row.adaptive - 36) < 1e-12);
    assert_true(fabs(row.entropy - (3 * log2(3) - 2)) < 1e-12);
    order0_channel(&row, v + 1, 2, 3); /* equal symbols take only the bounds */
    assert_int_equal(row.n, 6);
    assert_true(fabs(row.adaptive - 68) < 1e-12);
    assert_true(fabs(row.entropy - (3 * log2(3) - 2)) < 1e-12);
}

/* All symbols are counted, and no order-0 coder is below the entropy. */
TEST_OF(const fixture, order0_should_count_every_symbol)
{
    order0_row row[SAGA_N_COMPONENTS];

    order0_file(row, &f->f);
    assert_int_equal(row[SAGA_COMPONENT_TREE].n, 7 * f->f.s.n.coarse);
    assert_int_equal(row[SAGA_COMPONENT_CENTRE].n, 4 * f->f.s.n.coarse);
    assert_int_equal(row[SAGA_COMPONENT_FEATURE].n,
                     f->f.h.model.features * f->f.s.n.coarse);
    assert_int_equal(row[SAGA_COMPONENT_FINE_OFFSET].n, 4 * f->f.s.n.fine);
    assert_int_equal(row[SAGA_COMPONENT_N_PRIM].n, f->f.s.n.fine);
    assert_int_equal(row[SAGA_COMPONENT_PRIM_OFFSET].n, 4 * f->f.s.n.prim);
    for (int i = SAGA_COMPONENT_TREE; i < SAGA_N_COMPONENTS; i++)
        assert_true(row[i].adaptive > row[i].entropy ||
                    (i == SAGA_COMPONENT_CLASS && row[i].n == 0));
}

TEST_GROUP(set_up, tear_down);
