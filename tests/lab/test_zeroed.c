/* SPDX-License-Identifier: MIT
 *
 * Files are taken apart and put together again: unchanged, they must have the
 * same bytes; with zero features, all other values must stay. The streams are
 * random and have every context. SAGA_TEST_SEED is the first seed.
 */
#include "encode.h"
#include "gen_stream.h"
#include "gen_zeroed.h"
#include "head.h"
#include "ref_recorder.h"
#include "saga.h"
#include "testing.h"

enum { N_STREAMS = 60 };

static void make_stream(gen_stream *g, uint64_t i)
{
    const gen_options o = { .seed = testing_seed(1) + i,
                            .level = 2,
                            .n_segments = 1 +
                                          (uint32_t)(i % GEN_MAX_SEGMENTS) };

    *g = gen_stream_make(&o);
}

static int has_contexts(const gen_stream *g)
{
    const uint8_t *const sources = g->header.model.sources;

    return sources[0] || sources[1] || sources[2];
}

/* --- What a segment decodes to ------------------------------------------- */

/* The symbols of a file, and the values for which they stand. */
typedef struct {
    saga_symbols s;
    saga_scaffold sc;
} decoded;

static void decode(decoded *d, const gen_stream *g, const saga_nets *nets,
                   const uint8_t *params, const uint8_t *bytes, size_t n,
                   uint32_t frame)
{
    saga_net_symbols net_symbols = { 0 };
    saga_segment_header layers;
    recorder_chunks at;
    saga_header h;
    uint32_t final_range[3];
    saga_segment seg;
    recorder r;

    assert_ok(saga_find(&seg, bytes, n, frame, 1));
    assert_true(
        recorder_read(&net_symbols, &d->s, seg.number, final_range, bytes, n));
    saga_net_symbols_free(&net_symbols);
    recorder_free_symbols(&d->s);
    recorder_init(&r, NULL);
    r.s = &d->s;
    r.cap_nodes = recorder_nodes(d->s.n.coarse);
    r.features = g->header.model.features;
    recorder_alloc_symbols(&d->s, d->s.n, r.features, r.cap_nodes);
    recorder_scaffold(&d->sc, &g->header.model, nets, params, d->s.n);
    assert_ok(saga_head_read(&h, bytes, n));
    at = recorder_segment_chunks(&h, bytes, &seg);
    assert_true(recorder_segment(&layers, &h, &at));
    assert_true(recorder_fill(&r.coder, &r.inner, &d->sc, final_range, at));
}

static void free_decoded(decoded *d)
{
    recorder_free_symbols(&d->s);
    saga_scaffold_free(&d->sc);
}

/* --- Unchanged ----------------------------------------------------------- */

TEST(file_should_come_back_when_nothing_changes)
{
    for (uint64_t i = 0; i < N_STREAMS; i++) {
        FREED_BY(gen_stream_free) gen_stream g;
        uint8_t *bytes, *out = NULL;
        size_t n, n_out = 0;

        make_stream(&g, i);
        gen_stream_encode(&g, &bytes, &n);
        assert_null(zeroed_make(&out, &n_out, bytes, n, ZEROED_NOTHING));
        assert_int_equal(n_out, n);
        assert_memory_equal(out, bytes, n);
        free(out);
        free(bytes);
    }
}

TEST(broken_file_should_be_refused)
{
    FREED_BY(gen_stream_free) gen_stream g;
    uint8_t *bytes, *out = NULL;
    size_t n, n_out = 0;

    make_stream(&g, 0);
    gen_stream_encode(&g, &bytes, &n);
    bytes[n - 1] ^= 1;
    assert_string_equal(zeroed_make(&out, &n_out, bytes, n, ZEROED_FEATURES),
                        "a segment is not valid");
    bytes[0] ^= 1;
    assert_string_equal(zeroed_make(&out, &n_out, bytes, n, ZEROED_FEATURES),
                        "the header is not valid");
    assert_null(out);
    free(bytes);
}

/* --- Zeroed -------------------------------------------------------------- */

#define SAME(a, b, n) assert_memory_equal(a, b, (n) * sizeof *(a))

static void assert_same_integers(const saga_symbols *a, const saga_symbols *b)
{
    assert_int_equal(a->n_nodes, b->n_nodes);
    SAME(a->split, b->split, a->n_nodes);
    SAME(a->occupancy, b->occupancy, a->n_nodes);
    SAME(a->n_fine, b->n_fine, a->n.coarse);
    SAME(a->fine_suffix, b->fine_suffix, a->n.fine);
    SAME(a->n_prim, b->n_prim, a->n.fine);
    SAME(a->prim_suffix, b->prim_suffix, a->n.prim);
}

/* Checks that two values differ by at most half a step and an LSB for the
 * rounding on both sides. */
static void assert_within_step(int32_t a, int32_t b, uint32_t step_q16)
{
    if (abs(a - b) > step_q16 / 131072.0 + 1)
        fail_msg("%d is more than half a step from %d", a, b);
}

static void check_zeroed(const decoded *a, const decoded *z,
                         const gen_stream *g)
{
    const saga_model *const m = &g->header.model;
    const saga_counts n = a->s.n;

    assert_same_integers(&a->s, &z->s);
    for (uint32_t i = 0; i < m->features * n.coarse; i++)
        assert_within_step(z->sc.coarse_feature[i], 0,
                           m->step_q16[SAGA_STEP_FEATURE]);
    for (uint32_t i = 0; i < 4 * n.prim; i++)
        assert_within_step(z->sc.prim_offset[i / 4][i % 4],
                           a->sc.prim_offset[i / 4][i % 4],
                           m->step_q16[SAGA_STEP_PRIM]);
    if (has_contexts(g))
        return;
    /* Predictions do not depend on features, so that residuals are equal. */
    SAME(a->s.centre, z->s.centre, 4u * n.coarse);
    SAME(a->s.fine_offset, z->s.fine_offset, 4u * n.fine);
    SAME(a->s.prim_offset, z->s.prim_offset, 4u * n.prim);
}

static void compare_files(const gen_stream *g, const uint8_t *bytes, size_t n,
                          const uint8_t *out, size_t n_out)
{
    saga_error error = { "" };
    saga_encoder *const e = saga_encoder_open(&g->header, g->rig, &g->nets,
                                              &error);
    const saga_nets *nets;
    const uint8_t *params;
    uint32_t frame = 0;

    assert_non_null(e);
    params = saga_encoder_params(e, &nets);
    for (uint32_t i = 0; i < g->n_segments; frame += g->n_frames[i++]) {
        decoded a, z;

        decode(&a, g, nets, params, bytes, n, frame);
        decode(&z, g, nets, params, out, n_out, frame);
        check_zeroed(&a, &z, g);
        free_decoded(&a);
        free_decoded(&z);
    }
    saga_encoder_free(e);
}

static void zero_and_check(gen_stream *g)
{
    uint8_t *bytes, *out = NULL;
    size_t n, n_out = 0;

    gen_stream_encode(g, &bytes, &n);
    assert_null(zeroed_make(&out, &n_out, bytes, n, ZEROED_FEATURES));
    compare_files(g, bytes, n, out, n_out);
    free(out);
    free(bytes);
}

TEST(features_alone_should_become_zero)
{
    for (uint64_t i = 0; i < N_STREAMS; i++) {
        FREED_BY(gen_stream_free) gen_stream g;

        make_stream(&g, i);
        zero_and_check(&g);
    }
}

/* Streams without contexts, as the trainer makes them, are one in 256 of the
 * random ones. */
TEST(streams_without_contexts_should_keep_all_residuals)
{
    uint64_t i = 0;

    for (int n = 0; n < 2; i++) {
        FREED_BY(gen_stream_free) gen_stream g;

        make_stream(&g, i);
        if (!has_contexts(&g)) {
            zero_and_check(&g);
            n++;
        }
    }
}
