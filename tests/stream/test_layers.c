/* SPDX-License-Identifier: MIT
 *
 * Layers and the base. The primitives of each are compared with the same
 * symbols coded as separate segments, the picture with all of them sorted by
 * depth. A segment that is cut after a layer, and a file that saga_splice has
 * cut there, must equal the encoder's output for the remaining layers.
 */
#include "model.h"
#include "player.h"
#include "splice.h"
#include "testing.h"

enum { N_STREAMS = 12, N_SEGMENTS = 2, N_LAYERS = 3 };

/* Decodes the first n bytes of a segment, in a copy of exact size. */
static saga_status decode_bytes(player *p, size_t n)
{
    uint8_t *const copy = copy_of(p->bytes + p->seg.offset, n);
    const saga_status s = saga_decode(p->dec, &p->seg, copy, n, NULL);

    free(copy);
    assert_int_equal(saga_tell(&p->report, p->dec),
                     s == SAGA_OK ? SAGA_OK : SAGA_ERR_STATE);
    return s;
}

static void play(player *p, const gen_stream *g)
{
    player_open(p, g);
    player_decode(p, 0);
}

static gen_options options_of(uint32_t i)
{
    const gen_options o = { .seed = 80 + i,
                            .level = 1,
                            .n_coarse = 8,
                            .picture = 1,
                            .tools_fixed = 1,
                            .tools = i % 2 ? SAGA_TOOLS_PICTURE
                                           : SAGA_TOOL_SLOPE,
                            .n_segments = N_SEGMENTS,
                            .n_layers = N_LAYERS,
                            .bank = (int)(i % 3),
                            .no_fuse = i % 4,
                            .classes = i % 2 ? 2 + i % 3 : 0 };

    return o;
}

/* Returns a stream whose only segment is a part of the first picture of g,
 * whose memory it shares. */
static gen_stream part_alone(const gen_stream *g, const saga_symbols *part)
{
    gen_stream alone = *g;

    alone.has_base = 0;
    alone.header.more_layers = 0;
    alone.n_segments = 1;
    alone.segment[0] = *part;
    return alone;
}

/* Returns the stream with the first n layers of each segment. */
static gen_stream first_layers(const gen_stream *g, uint32_t n)
{
    gen_stream less = *g;

    less.header.more_layers = (uint8_t)(n - 1);
    for (uint32_t i = 0; i < g->n_segments * n; i++)
        less.segment[i] = g->segment[i / n * N_LAYERS + i % n];
    return less;
}

static void assert_same_primitive(const player *a, uint32_t i, const player *b,
                                  uint32_t k)
{
    const saga_animated x = player_primitive(a, i, 1000);
    const saga_animated y = player_primitive(b, k, 1000);

    assert_memory_equal(&x, &y, sizeof x);
}

/* --- Parts of a picture -------------------------------------------------- */

/* A player of the whole stream, and one of each of its parts. */
typedef struct {
    player all, part[N_LAYERS];
    int n;
} taken_apart;

static void take_apart(taken_apart *t, const gen_stream *g,
                       const saga_symbols *const part[], int n)
{
    t->n = n;
    play(&t->all, g);
    for (int k = 0; k < n; k++) {
        const gen_stream alone = part_alone(g, part[k]);

        play(&t->part[k], &alone);
    }
}

static void end(taken_apart *t)
{
    player_close(&t->all);
    for (int k = 0; k < t->n; k++)
        player_close(&t->part[k]);
}

static void assert_parts_are_primitives(const taken_apart *t)
{
    uint32_t first = 0;

    for (int k = 0; k < t->n; k++) {
        const player *const one = &t->part[k];

        for (uint32_t m = 0; m < one->report.n_primitives; m++)
            assert_same_primitive(&t->all, first + m, one, m);
        first += one->report.n_primitives;
    }
    assert_int_equal(t->all.report.n_primitives, first);
}

/* Returns the part whose next splat is the nearest; the first part if several
 * are equal. */
static int nearest(const taken_apart *t, const uint32_t at[N_LAYERS])
{
    int best = -1;

    for (int k = 0; k < t->n; k++)
        if (at[k] < t->part[k].report.n_splats &&
            (best < 0 || player_splat(&t->part[k], at[k]).depth <
                             player_splat(&t->part[best], at[best]).depth))
            best = k;
    return best;
}

static void assert_parts_are_drawn(taken_apart *t, uint32_t n_seen[N_LAYERS])
{
    uint32_t at[N_LAYERS] = { 0 };

    player_view(&t->all, 0, 0);
    for (int k = 0; k < t->n; k++)
        player_view(&t->part[k], 0, 0);
    for (uint32_t k = 0; k < t->all.report.n_splats; k++) {
        const int of = nearest(t, at);
        const saga_splat s = player_splat(&t->all, k);
        saga_splat want;

        assert_true(of >= 0);
        want = player_splat(&t->part[of], at[of]++);
        n_seen[of]++;
        /* Padding follows the last field. */
        assert_memory_equal(&s, &want, offsetof(saga_splat, y1) + sizeof s.y1);
    }
    for (int k = 0; k < t->n; k++)
        assert_int_equal(at[k], t->part[k].report.n_splats);
}

TEST(layers_should_be_what_their_symbols_are_alone)
{
    uint32_t n_seen[N_LAYERS] = { 0 };

    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        FREED_BY(end) taken_apart t;
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

        take_apart(&t, &g,
                   (const saga_symbols *[]){ &g.segment[0], &g.segment[1],
                                             &g.segment[2] },
                   3);
        assert_int_equal(t.all.report.n_layers, N_LAYERS);
        assert_parts_are_primitives(&t);
        assert_parts_are_drawn(&t, n_seen);
    }
    assert_true(n_seen[0] > 0 && n_seen[1] > 0 && n_seen[2] > 0);
}

/* --- The base ------------------------------------------------------------ */

static gen_options with_base(uint32_t i, uint32_t tools)
{
    const gen_options o = { .seed = 40 + i,
                            .level = 1,
                            .n_coarse = 8,
                            .picture = 1,
                            .tools_fixed = 1,
                            .tools = tools,
                            .n_segments = N_SEGMENTS,
                            .base = 1,
                            .bank = (int)(i % 3),
                            .no_fuse = i % 4,
                            .classes = i % 2 ? 2 + i % 3 : 0 };

    return o;
}

/* Without temporal tools a segment does not depend on time, and neither does a
 * base. A base must therefore give the splats that its symbols give as a
 * segment; at equal depth the base's splats come first. */
TEST(base_should_be_what_its_symbols_are_as_a_segment)
{
    uint32_t n_seen[N_LAYERS] = { 0 };

    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = with_base(i, i % 2 ? SAGA_TOOL_VIEW : 0);
        FREED_BY(end) taken_apart t;
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

        take_apart(&t, &g, (const saga_symbols *[]){ &g.base, &g.segment[0] },
                   2);
        assert_int_equal(t.all.info.base_primitives,
                         t.part[0].report.n_primitives);
        assert_parts_are_primitives(&t);
        assert_parts_are_drawn(&t, n_seen);
    }
    assert_true(n_seen[0] > 0 && n_seen[1] > 0);
}

static void check_still(const player *p, const saga_animated *first)
{
    static const int32_t times[] = { 0, 1, 32768, 65535 };

    for (uint32_t k = 0; k < p->info.base_primitives; k++)
        for (size_t m = 0; m < sizeof times / sizeof *times; m++) {
            const saga_animated a = player_primitive(p, k, times[m]);

            assert_memory_equal(&a, &first[k], sizeof a);
        }
}

TEST(no_time_and_no_segment_should_change_the_base)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = with_base(i, SAGA_TOOLS_PICTURE);
        FREED saga_animated *first;
        FREED_BY(player_close) player p;

        player_make(&p, &o);
        player_decode(&p, 0);
        first = zeroed(p.info.base_primitives, sizeof *first);
        for (uint32_t k = 0; k < p.info.base_primitives; k++)
            first[k] = player_primitive(&p, k, 12345);
        check_still(&p, first);
        player_decode(&p, 1);
        check_still(&p, first);
    }
}

TEST(a_broken_segment_should_leave_the_base)
{
    const gen_options o = with_base(0, SAGA_TOOLS_PICTURE);
    saga_animated before, after;
    FREED_BY(player_close) player p;

    player_make(&p, &o);
    player_decode(&p, 0);
    before = player_primitive(&p, 0, 0);
    assert_int_equal(decode_bytes(&p, p.seg.nbytes - 1), SAGA_ERR_TRUNCATED);
    assert_int_equal(saga_primitive_at(&after, p.dec, 0, 0), SAGA_ERR_STATE);
    player_decode(&p, 1);
    after = player_primitive(&p, 0, 0);
    assert_memory_equal(&before, &after, sizeof before);
}

/* --- Cuts ---------------------------------------------------------------- */

static saga_layer_report layer_of(player *p, uint32_t layer)
{
    saga_layer_report r;

    assert_ok(saga_find_layer(&r, p->dec, &p->seg, p->bytes + p->seg.offset,
                              SAGA_LAYERS_NBYTES, layer));
    return r;
}

/* A layer must be decoded if and only if all its bytes are present. */
TEST(cut_segment_should_have_the_layers_that_are_whole)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        uint32_t n_prim = 0;
        player all, cut;
        FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

        play(&all, &g);
        play(&cut, &g);
        for (uint32_t k = 0; k < N_LAYERS; k++) {
            const saga_layer_report r = layer_of(&all, k);

            assert_int_equal(r.n_coarse, g.segment[k].n.coarse);
            assert_int_equal(r.n_fine, g.segment[k].n.fine);
            assert_int_equal(r.n_primitives, g.segment[k].n.prim);
            n_prim += r.n_primitives;
            assert_int_equal(decode_bytes(&cut, r.end - 1),
                             k ? SAGA_OK : SAGA_ERR_TRUNCATED);
            assert_true(k == 0 || cut.report.n_layers == k);
            assert_ok(decode_bytes(&cut, r.end));
            assert_int_equal(cut.report.n_layers, k + 1);
            assert_int_equal(cut.report.n_primitives, n_prim);
            for (uint32_t m = 0; m < n_prim; m++)
                assert_same_primitive(&cut, m, &all, m);
        }
        assert_int_equal(layer_of(&all, N_LAYERS - 1).end, all.seg.nbytes);
        player_close(&all);
        player_close(&cut);
    }
}

/* A changed byte in a layer that is cut must not be noticed; in a complete
 * layer it must be. */
TEST(damage_should_count_in_whole_layers_only)
{
    const gen_options o = options_of(0);
    FREED_BY(player_close) player p;
    size_t end_of_1, end_of_2;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    play(&p, &g);
    end_of_1 = layer_of(&p, 0).end;
    end_of_2 = layer_of(&p, 1).end;
    p.bytes[p.seg.offset + end_of_2 - 1] ^= 1;
    assert_int_equal(decode_bytes(&p, p.seg.nbytes), SAGA_ERR_DATA);
    assert_int_equal(decode_bytes(&p, end_of_2), SAGA_ERR_DATA);
    p.bytes[p.seg.offset + end_of_1] ^= 1;
    assert_ok(decode_bytes(&p, end_of_2 - 1));
    assert_int_equal(p.report.n_layers, 1);
    assert_ok(decode_bytes(&p, end_of_1));
}

TEST(cut_file_should_be_what_the_encoder_makes_of_fewer)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        gen_options o = options_of(i);
        saga_error error = { "" };
        FREED_BY(gen_stream_free) gen_stream g;
        FREED uint8_t *bytes;
        size_t n;

        o.base = i % 2 == 1;
        o.named = i % 3 == 1;
        g = gen_stream_make(&o);
        gen_stream_encode(&g, &bytes, &n);
        for (uint32_t k = 1; k <= N_LAYERS; k++) {
            const saga_splice_part part = {
                .name = "it", .bytes = bytes, .nbytes = n, .n_layers = k
            };
            gen_stream less = first_layers(&g, k);
            uint8_t *cut, *want;
            size_t n_cut, n_want;

            gen_stream_encode(&less, &want, &n_want);
            if (!saga_splice(&cut, &n_cut, &part, 1, &error))
                fail_msg("%s", error.message);
            assert_int_equal(n_cut, n_want);
            assert_memory_equal(cut, want, n_want);
            free(cut);
            free(want);
        }
    }
}

TEST(more_layers_than_there_are_should_be_refused)
{
    const gen_options o = options_of(1);
    saga_layer_report layer;
    saga_error error = { "" };
    saga_splice_part part = { .name = "it", .n_layers = N_LAYERS + 1 };
    uint8_t *cut;
    FREED_BY(player_close) player p;
    size_t n;
    FREED_BY(gen_stream_free) gen_stream g = gen_stream_make(&o);

    play(&p, &g);
    part.bytes = p.bytes;
    part.nbytes = p.n;
    assert_false(saga_splice(&cut, &n, &part, 1, &error));
    assert_non_null(strstr(error.message, "its layers: 3; asked for: 4"));
    assert_int_equal(saga_find_layer(&layer, p.dec, &p.seg,
                                     p.bytes + p.seg.offset, p.seg.nbytes,
                                     N_LAYERS),
                     SAGA_ERR_ARG);
    assert_int_equal(
        saga_find_layer(&layer, p.dec, &p.seg, p.bytes + p.seg.offset, 71, 0),
        SAGA_ERR_TRUNCATED);
}
