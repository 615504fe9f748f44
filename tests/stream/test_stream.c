/* SPDX-License-Identifier: MIT
 *
 * Encoder and decoder are inverse: random symbols and networks are coded to
 * bytes, and all come back. SAGA_TEST_SEED is the first seed, SAGA_TEST_COUNT
 * the number of streams.
 */
#include "encode.h"
#include "player.h"
#include "ref_recorder.h"
#include "testing.h"

/* --- Comparing ----------------------------------------------------------- */

#define SAME(a, b, n) assert_memory_equal(a, b, (n) * sizeof *(a))

static void assert_same_symbols(const saga_symbols *a, const saga_symbols *b,
                                const saga_model *m)
{
    assert_int_equal(a->n.coarse, b->n.coarse);
    assert_int_equal(a->n.fine, b->n.fine);
    assert_int_equal(a->n.prim, b->n.prim);
    assert_int_equal(a->n_nodes, b->n_nodes);
    SAME(a->split, b->split, a->n_nodes);
    SAME(a->occupancy, b->occupancy, a->n_nodes);
    SAME(a->n_fine, b->n_fine, a->n.coarse);
    if (m->tools & SAGA_TOOL_CLASSES)
        SAME(a->class, b->class, a->n.coarse);
    SAME(a->centre, b->centre, 4u * a->n.coarse);
    SAME(a->feature, b->feature, (size_t)m->features * a->n.coarse);
    SAME(a->fine_suffix, b->fine_suffix, a->n.fine);
    SAME(a->fine_offset, b->fine_offset, 4u * a->n.fine);
    SAME(a->n_prim, b->n_prim, a->n.fine);
    SAME(a->prim_suffix, b->prim_suffix, a->n.prim);
    SAME(a->prim_offset, b->prim_offset, 4u * a->n.prim);
}

static void assert_same_layer(const saga_layer_symbols *a,
                              const saga_layer_symbols *b, size_t n_in,
                              size_t n_out, size_t n_finer)
{
    assert_int_equal(a->step_q16, b->step_q16);
    assert_int_equal(a->step_shift, b->step_shift);
    assert_int_equal(a->bias_shift, b->bias_shift);
    assert_int_equal(a->weight_scale, b->weight_scale);
    assert_int_equal(a->bias_scale, b->bias_scale);
    assert_int_equal(a->scale_mode, b->scale_mode);
    SAME(a->drop, b->drop,
         saga_scale_lines(a->scale_mode, (uint32_t)n_in, (uint32_t)n_out));
    SAME(a->weight, b->weight, n_in * n_out);
    SAME(a->bias, b->bias, n_out);
    SAME(a->shift, b->shift, n_out);
    SAME(a->finer, b->finer, n_finer);
}

static void assert_same_nets(const saga_net_symbols *a,
                             const saga_net_symbols *b, const saga_model *m)
{
    saga_nets nets;

    saga_nets_layout(&nets, m);
    for (int net = 0; net < SAGA_N_NETS; net++)
        for (int i = 0; i < nets.shape[net].n_layers; i++)
            assert_same_layer(
                &a->layer[net][i], &b->layer[net][i], nets.shape[net].dim[i],
                nets.shape[net].dim[i + 1], saga_nets_n_finer(&nets, net, i));
}

/* --- One stream there and back ------------------------------------------- */

/* Returns the segment that begins after the frames of those before it. */
static saga_segment segment_of(player *p, const gen_stream *g, uint32_t number)
{
    const saga_segment seg = player_find(p, number);
    uint32_t frame = 0;

    for (uint32_t i = 0; i < number; i++)
        frame += g->n_frames[i];
    assert_int_equal(seg.first_frame, frame);
    assert_int_equal(seg.n_frames, g->n_frames[number]);
    assert_int_equal(seg.t, 0);
    assert_true(seg.offset <= p->n && seg.nbytes <= p->n - seg.offset);
    return seg;
}

static void check_layer(const gen_stream *g, const saga_symbols *want,
                        uint32_t number, uint32_t range[3],
                        const uint8_t *bytes, size_t n)
{
    FREED_BY(saga_net_symbols_free) saga_net_symbols nets = { 0 };
    FREED_BY(recorder_free_symbols) saga_symbols s = { 0 };

    assert_true(recorder_read(&nets, &s, number, range, bytes, n));
    assert_same_nets(&nets, &g->nets, &g->header.model);
    assert_same_symbols(&s, want, &g->header.model);
}

/* Decodes a segment from a copy of exact size. */
static void decode_copy(player *p, const gen_stream *g, uint32_t number)
{
    const saga_segment seg = segment_of(p, g, number);
    FREED uint8_t *const copy = copy_of(p->bytes + seg.offset, seg.nbytes);

    assert_ok(saga_decode(p->dec, &seg, copy, seg.nbytes, NULL));
}

static void check_segment(player *p, const gen_stream *g, uint32_t number)
{
    const uint32_t n_layers = saga_n_layers(&g->header);
    saga_counts sum = { 0, 0, 0 };
    saga_report report;
    uint32_t range[3];

    for (uint32_t i = 0; i < n_layers; i++) {
        const saga_symbols *const want = &g->segment[number * n_layers + i];

        check_layer(g, want, RECORDER_LAYER(number, i), range, p->bytes, p->n);
        sum.coarse += want->n.coarse;
        sum.fine += want->n.fine;
        sum.prim += want->n.prim;
    }
    decode_copy(p, g, number);
    assert_ok(saga_tell(&report, p->dec));
    assert_int_equal(report.n_layers, n_layers);
    assert_int_equal(report.n_coarse, sum.coarse);
    assert_int_equal(report.n_fine, sum.fine);
    assert_int_equal(report.n_primitives, g->base.n.prim + sum.prim);
    for (uint32_t i = 0; i < 3; i++)
        assert_int_equal(report.final_range[i], range[i]);
}

static void check_base(const player *p, const gen_stream *g)
{
    saga_net_symbols nets = { 0 };
    saga_symbols s;
    uint32_t range[3];

    assert_int_equal(p->info.base_coarse, g->base.n.coarse);
    if (!g->has_base)
        return;
    assert_true(recorder_read(&nets, &s, RECORDER_BASE, range, p->bytes, p->n));
    assert_same_symbols(&s, &g->base, &g->header.model);
    saga_net_symbols_free(&nets);
    recorder_free_symbols(&s);
}

static void check_stream(gen_stream *g)
{
    FREED_BY(player_close) player p;

    player_open(&p, g);
    assert_int_equal(p.info.n_segments, g->n_segments);
    check_base(&p, g);
    for (uint32_t i = 0; i < g->n_segments; i++)
        check_segment(&p, g, i);
}

/* Returns the options of trial i. Most have level 0 or 1: the others differ
 * only in having larger networks. */
static gen_options options_of(uint64_t seed, uint32_t i)
{
    gen_options o = { .seed = seed,
                      .level = i % 64 == 63   ? 3
                               : i % 32 == 31 ? 2
                                              : i / 32 % 2,
                      .n_coarse = i % 10 == 9 ? 40 : 0,
                      .n_segments = i % 8 ? 1 : 1 + i / 8 % GEN_MAX_SEGMENTS,
                      .tools_fixed = 1,
                      .tools = i % 32,
                      .bank = (int)(i / 2 % 3),
                      .base = i % 5 == 1,
                      .n_layers = i % 7 == 3 ? 2 + i % 2 : 1,
                      .classes = i % 3 ? 0 : 2 + i / 3 % 3 };

    return o;
}

TEST(stream_should_decode_to_the_symbols_it_was_made_from)
{
    const uint64_t seed = testing_seed(1);
    const uint32_t n = testing_count(300, 100000);

    printf("seeds from %" PRIu64 ", %" PRIu32 " streams\n", seed, n);
    for (uint32_t i = 0; i < n; i++) {
        const gen_options o = options_of(seed + i, i);
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

        check_stream(&g);
    }
}

/* --- Limits -------------------------------------------------------------- */

/* Makes the first stream whose tree reaches the limits of level 0. */
static void make_full(gen_stream *g)
{
    const saga_level_caps *const cap = &saga_caps[0];
    gen_options o = { .full = 1,
                      .tools_fixed = 1,
                      .tools = SAGA_TOOLS_PICTURE,
                      .bank = GEN_BANK_ORTHOGONAL };

    for (o.seed = testing_seed(1);; o.seed++) {
        const saga_symbols *const s = &g->segment[0];

        *g = gen_stream_make(&o);
        if (s->n.coarse == GEN_FULL_COARSE && s->n.fine == cap->n_fine &&
            s->n.prim == cap->n_prim)
            return;
        gen_stream_free(g);
    }
}

TEST(stream_should_survive_a_full_level_0)
{
    FREED_BY(gen_stream_free) gen_stream g;

    make_full(&g);
    check_stream(&g);
}

TEST(stream_should_survive_layers_without_anchors)
{
    const gen_options o = {
        .seed = testing_seed(1), .level = 1, .n_coarse = 9, .n_segments = 3
    };
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);
    saga_symbols *s = &g.segment[0];

    memset(s->n_fine, 0, s->n.coarse);
    s->n.fine = s->n.prim = 0;
    s = &g.segment[1];
    memset(s->n_prim, 0, s->n.fine);
    s->n.prim = 0;
    check_stream(&g);
}

/* Every set has its largest size, and all its members are equal. */
TEST(stream_should_survive_full_sets_of_equal_suffixes)
{
    FREED_BY(gen_stream_free) gen_stream g;
    saga_symbols *s;

    make_full(&g);
    s = &g.segment[0];
    for (uint32_t i = 0; i < s->n.prim; i++)
        s->prim_suffix[i] = 0;
    for (uint32_t i = 0; i < s->n.fine; i++)
        s->fine_suffix[i] = 0;
    check_stream(&g);
}

TEST(stream_should_survive_every_extreme_residual)
{
    FREED_BY(gen_stream_free) gen_stream g;
    saga_symbols *s;

    make_full(&g);
    s = &g.segment[0];
    for (uint32_t i = 0; i < 4 * s->n.coarse; i++)
        s->centre[i] = i & 1 ? SAGA_MAX_RESIDUAL : -SAGA_MAX_RESIDUAL;
    for (uint32_t i = 0; i < g.header.model.features * s->n.coarse; i++)
        s->feature[i] = i & 2 ? SAGA_MAX_RESIDUAL : -SAGA_MAX_RESIDUAL;
    for (uint32_t i = 0; i < 4 * s->n.fine; i++)
        s->fine_offset[i] = i & 4 ? SAGA_MAX_RESIDUAL : -SAGA_MAX_RESIDUAL;
    for (uint32_t i = 0; i < 4 * s->n.prim; i++)
        s->prim_offset[i] = i & 8 ? SAGA_MAX_RESIDUAL : -SAGA_MAX_RESIDUAL;
    check_stream(&g);
}
