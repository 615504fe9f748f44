/* SPDX-License-Identifier: MIT
 *
 * Layers: the same symbols as segments of their own say what the primitives of
 * each are, sorting all by depth says how they are drawn. A segment that is cut
 * behind a layer, and a file that saga_splice has cut there, is what an encoder
 * makes of the layers that are left.
 */
#include "gen_stream.h"
#include "model.h"
#include "saga.h"
#include "splice.h"
#include "testing.h"

enum { N_STREAMS = 12, N_SEGMENTS = 2, N_LAYERS = 3 };

typedef struct {
    uint8_t *bytes, *work;
    size_t n;
    saga_info info;
    saga_decoder *dec;
    saga_segment seg;
    saga_report report;
    saga_camera camera;
} player;

/* The first n bytes of a segment, in an exact copy. */
static saga_status decode_bytes(player *p, size_t n)
{
    uint8_t *const copy = must(malloc(n + 1));
    saga_status s;

    memcpy(copy, p->bytes + p->seg.offset, n);
    s = saga_decode(p->dec, &p->seg, copy, n, NULL);
    free(copy);
    if (s == SAGA_OK)
        assert_int_equal(saga_tell(&p->report, p->dec), SAGA_OK);
    else
        assert_int_equal(saga_tell(&p->report, p->dec), SAGA_ERR_STATE);
    return s;
}

static void find(player *p, uint32_t number)
{
    uint32_t frame = 0;

    do {
        assert_int_equal(saga_find(&p->seg, p->bytes, p->n, frame, 1),
                         SAGA_OK);
        frame += p->seg.n_frames;
    } while (p->seg.number != number);
}

static void play(player *p, const gen_stream *g)
{
    gen_stream copy = *g;
    uint32_t number;

    gen_stream_encode(&copy, &p->bytes, &p->n);
    assert_int_equal(saga_probe(&p->info, p->bytes, p->n), SAGA_OK);
    p->work = must(aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes));
    assert_int_equal(saga_open(&p->dec, p->work, p->info.work_nbytes, p->bytes,
                               p->info.head_nbytes, NULL), SAGA_OK);
    assert_int_equal(saga_rig(&p->camera, &number, p->bytes, p->n, 0),
                     SAGA_OK);
    find(p, 0);
    assert_int_equal(decode_bytes(p, p->seg.nbytes), SAGA_OK);
}

static void end(player *p)
{
    free(p->work);
    free(p->bytes);
}

static gen_options options_of(uint32_t i)
{
    const gen_options o = {
        .seed = 80 + i, .level = 1, .n_coarse = 8, .picture = 1,
        .tools_fixed = 1,
        .tools = i % 2 ? SAGA_TOOLS_PICTURE : SAGA_TOOL_SLOPE,
        .n_segments = N_SEGMENTS, .n_layers = N_LAYERS,
        .bank = (int)(i % 3), .no_fuse = i % 4
    };

    return o;
}

/* The stream with a layer of its first segment as the only one. */
static gen_stream layer_alone(const gen_stream *g, uint32_t layer)
{
    gen_stream alone = *g;

    alone.header.more_layers = 0;
    alone.n_segments = 1;
    alone.segment[0] = g->segment[layer];
    return alone;
}

/* The stream with the first n layers of each segment. */
static gen_stream first_layers(const gen_stream *g, uint32_t n)
{
    gen_stream less = *g;

    less.header.more_layers = (uint8_t)(n - 1);
    for (uint32_t i = 0; i < g->n_segments * n; i++)
        less.segment[i] = g->segment[i / n * N_LAYERS + i % n];
    return less;
}

static void assert_same_primitive(const player *a, uint32_t i,
                                  const player *b, uint32_t k)
{
    saga_animated x, y;

    assert_int_equal(saga_primitive_at(&x, a->dec, i, 1000), SAGA_OK);
    assert_int_equal(saga_primitive_at(&y, b->dec, k, 1000), SAGA_OK);
    assert_memory_equal(&x, &y, sizeof x);
}

TEST(layer_should_be_what_its_symbols_are_alone)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        uint32_t first = 0;
        gen_stream g;
        player all;

        gen_stream_make(&g, &o);
        play(&all, &g);
        assert_int_equal(all.report.n_layers, N_LAYERS);
        for (uint32_t k = 0; k < N_LAYERS; k++) {
            const gen_stream alone = layer_alone(&g, k);
            player one;

            play(&one, &alone);
            for (uint32_t m = 0; m < one.report.n_primitives; m++)
                assert_same_primitive(&all, first + m, &one, m);
            first += one.report.n_primitives;
            end(&one);
        }
        assert_int_equal(all.report.n_primitives, first);
        end(&all);
        gen_stream_free(&g);
    }
}

static void view(player *p)
{
    assert_int_equal(saga_view(p->dec, &p->camera, 0), SAGA_OK);
    assert_int_equal(saga_tell(&p->report, p->dec), SAGA_OK);
}

static saga_splat splat_at(const player *p, uint32_t order)
{
    saga_splat s;

    assert_int_equal(saga_splat_at(&s, p->dec, order), SAGA_OK);
    return s;
}

/* The layer whose next splat is the nearest; the first of equals. */
static int nearest(const player part[N_LAYERS], const uint32_t at[N_LAYERS])
{
    int best = -1;

    for (int k = 0; k < N_LAYERS; k++)
        if (at[k] < part[k].report.n_splats &&
            (best < 0 || splat_at(&part[k], at[k]).depth <
                         splat_at(&part[best], at[best]).depth))
            best = k;
    return best;
}

TEST(layers_should_be_drawn_in_one_order_of_depth)
{
    uint32_t n_seen[N_LAYERS] = { 0 };

    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        uint32_t at[N_LAYERS] = { 0 };
        player all, part[N_LAYERS];
        gen_stream g;

        gen_stream_make(&g, &o);
        play(&all, &g);
        view(&all);
        for (uint32_t k = 0; k < N_LAYERS; k++) {
            const gen_stream alone = layer_alone(&g, k);

            play(&part[k], &alone);
            view(&part[k]);
        }
        for (uint32_t k = 0; k < all.report.n_splats; k++) {
            const int of = nearest(part, at);
            saga_splat s = splat_at(&all, k), want;

            assert_true(of >= 0);
            want = splat_at(&part[of], at[of]++);
            n_seen[of]++;
            /* Padding follows the last field. */
            assert_memory_equal(&s, &want,
                                offsetof(saga_splat, y1) + sizeof s.y1);
        }
        end(&all);
        for (uint32_t k = 0; k < N_LAYERS; k++) {
            assert_int_equal(at[k], part[k].report.n_splats);
            end(&part[k]);
        }
        gen_stream_free(&g);
    }
    assert_true(n_seen[0] > 0 && n_seen[1] > 0 && n_seen[2] > 0);
}

static saga_layer_report layer_of(player *p, uint32_t layer)
{
    saga_layer_report r;

    assert_int_equal(saga_find_layer(&r, p->dec, &p->seg, p->bytes +
                                     p->seg.offset, SAGA_LAYERS_NBYTES,
                                     layer), SAGA_OK);
    return r;
}

/* Whole or not, a layer is decoded as soon as its last byte is there. */
TEST(cut_segment_should_have_the_layers_that_are_whole)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        uint32_t n_prim = 0;
        gen_stream g;
        player all, cut;

        gen_stream_make(&g, &o);
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
            assert_int_equal(decode_bytes(&cut, r.end), SAGA_OK);
            assert_int_equal(cut.report.n_layers, k + 1);
            assert_int_equal(cut.report.n_primitives, n_prim);
            for (uint32_t m = 0; m < n_prim; m++)
                assert_same_primitive(&cut, m, &all, m);
        }
        assert_int_equal(layer_of(&all, N_LAYERS - 1).end, all.seg.nbytes);
        end(&all);
        end(&cut);
        gen_stream_free(&g);
    }
}

/* What is cut may be anything; what is whole may not. */
TEST(damage_should_count_in_whole_layers_only)
{
    const gen_options o = options_of(0);
    gen_stream g;
    player p;
    size_t end_of_1, end_of_2;

    gen_stream_make(&g, &o);
    play(&p, &g);
    end_of_1 = layer_of(&p, 0).end;
    end_of_2 = layer_of(&p, 1).end;
    p.bytes[p.seg.offset + end_of_2 - 1] ^= 1;
    assert_int_equal(decode_bytes(&p, p.seg.nbytes), SAGA_ERR_DATA);
    assert_int_equal(decode_bytes(&p, end_of_2), SAGA_ERR_DATA);
    p.bytes[p.seg.offset + end_of_1] ^= 1;
    assert_int_equal(decode_bytes(&p, end_of_2 - 1), SAGA_OK);
    assert_int_equal(p.report.n_layers, 1);
    assert_int_equal(decode_bytes(&p, end_of_1), SAGA_OK);
    end(&p);
    gen_stream_free(&g);
}

TEST(cut_file_should_be_what_the_encoder_makes_of_fewer)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        gen_options o = options_of(i);
        saga_error error = { "" };
        gen_stream g;
        uint8_t *bytes;
        size_t n;

        o.base = i % 2 == 1;
        o.named = i % 3 == 1;
        gen_stream_make(&g, &o);
        gen_stream_encode(&g, &bytes, &n);
        for (uint32_t k = 1; k <= N_LAYERS; k++) {
            const saga_splice_part part = { .name = "it", .bytes = bytes,
                                            .nbytes = n, .n_layers = k };
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
        free(bytes);
        gen_stream_free(&g);
    }
}

TEST(more_layers_than_there_are_should_be_refused)
{
    const gen_options o = options_of(1);
    saga_layer_report layer;
    saga_error error = { "" };
    saga_splice_part part = { .name = "it", .n_layers = N_LAYERS + 1 };
    gen_stream g;
    uint8_t *cut;
    player p;
    size_t n;

    gen_stream_make(&g, &o);
    play(&p, &g);
    part.bytes = p.bytes;
    part.nbytes = p.n;
    assert_false(saga_splice(&cut, &n, &part, 1, &error));
    assert_non_null(strstr(error.message, "its layers: 3; asked for: 4"));
    assert_int_equal(saga_find_layer(&layer, p.dec, &p.seg, p.bytes +
                                     p.seg.offset, p.seg.nbytes, N_LAYERS),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_find_layer(&layer, p.dec, &p.seg, p.bytes +
                                     p.seg.offset, 71, 0),
                     SAGA_ERR_TRUNCATED);
    end(&p);
    gen_stream_free(&g);
}
