/* SPDX-License-Identifier: MIT
 *
 * The quantiser in closed loop. For all sources of entropy parameters
 * (hyperprior, parent, groups, bank), its symbols must be accepted by the
 * encoder and decode to themselves, and every dequantised value must be within
 * half a step of its target.
 */
#include "encode.h"
#include "gen_stream.h"
#include "quantise.h"
#include "ref_recorder.h"
#include "testing.h"

/* The targets: positions anywhere in the cube, features within +-4. */
typedef struct {
    double *x[3]; /* coarse, fine, prim */
    float *feature, *decoded;
} wanted;

static void make_wanted(wanted *w, const saga_counts *n, uint32_t features,
                        uint64_t *r)
{
    const uint32_t count[3] = { n->coarse, n->fine, n->prim };

    for (uint32_t k = 0; k < 3; k++) {
        w->x[k] = zeroed(4 * (size_t)count[k], sizeof(double));
        for (uint32_t i = 0; i < 4 * count[k]; i++)
            w->x[k][i] = i % 4 == 3 ? gen_range(r, 0, 65535)
                                    : gen_range(r, -(1 << 23), 1 << 23);
    }
    w->feature = zeroed((size_t)n->coarse * features, sizeof(float));
    w->decoded = zeroed((size_t)n->coarse * features, sizeof(float));
    for (uint32_t i = 0; i < n->coarse * features; i++)
        w->feature[i] = (float)gen_range(r, -4096, 4096) / 1024;
}

static void free_wanted(wanted *w)
{
    for (int k = 0; k < 3; k++)
        free(w->x[k]);
    free(w->feature);
    free(w->decoded);
}

static void quantise(gen_stream *g, const saga_encoder *e, const wanted *w)
{
    const saga_targets targets = { w->x[0], w->feature, w->x[1],
                                   w->x[2], NULL,       NULL };
    saga_decoded decoded = { .feature = w->decoded };
    saga_symbols *const s = &g->segment[0];
    saga_quantise_report report;

    decoded.coarse_x = zeroed(4 * (size_t)s->n.coarse, sizeof(double));
    decoded.fine_x = zeroed(4 * (size_t)s->n.fine, sizeof(double));
    decoded.prim_x = zeroed(4 * (size_t)s->n.prim, sizeof(double));
    decoded.order = zeroed(s->n.prim, sizeof *decoded.order);
    assert_done(
        saga_quantise_segment(s, &report, e, &targets, &decoded, &error));
    free(decoded.coarse_x);
    free(decoded.fine_x);
    free(decoded.prim_x);
    free(decoded.order);
}

/* The tolerance is half a step, and half an LSB for the rounding of the
 * dequantisation. */
static void assert_wanted(const gen_stream *g, const wanted *w)
{
    const saga_model *const m = &g->header.model;
    const int q = m->out_q[SAGA_OUT_COARSE];
    const double step = m->step_q16[SAGA_STEP_FEATURE] / 65536.0;

    for (uint32_t i = 0; i < g->segment[0].n.coarse * m->features; i++)
        assert_true(fabs((double)w->feature[i] - (double)w->decoded[i]) <=
                    ldexp(step / 2 + 0.51, -q));
}

static void assert_same(const saga_symbols *a, const saga_symbols *b,
                        uint32_t features)
{
    assert_memory_equal(a->centre, b->centre, 16 * (size_t)a->n.coarse);
    assert_memory_equal(a->feature, b->feature,
                        4 * (size_t)a->n.coarse * features);
    assert_memory_equal(a->fine_offset, b->fine_offset, 16 * (size_t)a->n.fine);
    assert_memory_equal(a->prim_suffix, b->prim_suffix, 4 * (size_t)a->n.prim);
    assert_memory_equal(a->prim_offset, b->prim_offset, 16 * (size_t)a->n.prim);
}

static void check_loop(uint32_t i)
{
    const gen_options o = { .seed = testing_seed(1) + i,
                            .level = (int)(i & 1u),
                            .n_coarse = 12,
                            .picture = 1,
                            .bank = (int)(i % 3) };
    uint64_t r = i;
    FREED_BY(saga_net_symbols_free) saga_net_symbols nets;
    FREED_BY(recorder_free_symbols) saga_symbols back;
    saga_encode_sizes sizes;
    saga_encoder *e;
    uint32_t range[3];
    FREED uint8_t *bytes;
    FREED_BY(free_wanted) wanted w;
    size_t n;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    assert_done(e = saga_encoder_open(&g.header, g.rig, &g.nets, &error));
    make_wanted(&w, &g.segment[0].n, g.header.model.features, &r);
    quantise(&g, e, &w);
    assert_wanted(&g, &w);
    assert_done(saga_encoder_segment(e, &g.segment[0], 1, &error));
    assert_done(saga_encoder_finish(e, &bytes, &n, &sizes, &error));
    assert_true(recorder_read(&nets, &back, 0, range, bytes, n));
    assert_same(&g.segment[0], &back, g.header.model.features);
    saga_encoder_free(e);
}

TEST(quantised_values_should_return_from_the_bytes)
{
    printf("seeds from %" PRIu64 "\n", testing_seed(1));
    for (uint32_t i = 0; i < 60; i++)
        check_loop(i);
}
