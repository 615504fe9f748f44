/* SPDX-License-Identifier: MIT
 *
 * The base: the same symbols as a segment of their own say what its primitives
 * are, sorting both by depth says how they are drawn.
 */
#include "gen_stream.h"
#include "model.h"
#include "saga.h"
#include "testing.h"

enum { N_STREAMS = 12, N_SEGMENTS = 2 };

typedef struct {
    uint8_t *bytes, *work;
    size_t n;
    saga_info info;
    saga_decoder *dec;
    saga_report report;
    saga_camera camera;
} player;

static void decode(player *p, uint32_t number)
{
    saga_segment seg = { .n_frames = 0 };

    for (uint32_t frame = 0, i = 0; i <= number; i++) {
        assert_int_equal(saga_find(&seg, p->bytes, p->n, frame, 1), SAGA_OK);
        frame += seg.n_frames;
    }
    assert_int_equal(saga_decode(p->dec, &seg, p->bytes + seg.offset,
                                 seg.nbytes, NULL), SAGA_OK);
    assert_int_equal(saga_tell(&p->report, p->dec), SAGA_OK);
}

static void play(player *p, gen_stream *g)
{
    uint32_t number;

    gen_stream_encode(g, &p->bytes, &p->n);
    assert_int_equal(saga_probe(&p->info, p->bytes, p->n), SAGA_OK);
    p->work = must(aligned_alloc(SAGA_WORK_ALIGN, p->info.work_nbytes));
    assert_int_equal(saga_open(&p->dec, p->work, p->info.work_nbytes, p->bytes,
                               p->info.head_nbytes, NULL), SAGA_OK);
    assert_int_equal(saga_rig(&p->camera, &number, p->bytes, p->n, 0),
                     SAGA_OK);
    decode(p, 0);
}

static void end(player *p)
{
    free(p->work);
    free(p->bytes);
}

static gen_options options_of(uint32_t i, uint32_t tools)
{
    const gen_options o = {
        .seed = 40 + i, .level = 1, .n_coarse = 8, .picture = 1,
        .tools_fixed = 1, .tools = tools, .n_segments = N_SEGMENTS,
        .base = 1, .bank = (int)(i % 3), .no_fuse = i % 4
    };

    return o;
}

/* The stream with its base as the only segment, which shares its memory. */
static gen_stream base_alone(const gen_stream *g)
{
    gen_stream alone = *g;

    alone.has_base = 0;
    alone.n_segments = 1;
    alone.segment[0] = g->base;
    return alone;
}

static gen_stream segment_alone(const gen_stream *g)
{
    gen_stream alone = *g;

    alone.has_base = 0;
    alone.n_segments = 1;
    return alone;
}

static void assert_same_primitive(const player *a, uint32_t i,
                                  const player *b, uint32_t k, int32_t t)
{
    saga_animated x, y;

    assert_int_equal(saga_primitive_at(&x, a->dec, i, t), SAGA_OK);
    assert_int_equal(saga_primitive_at(&y, b->dec, k, t), SAGA_OK);
    assert_memory_equal(&x, &y, sizeof x);
}

/* Without temporal tools a segment stands as still as the base. */
TEST(base_should_be_what_its_symbols_are_as_a_segment)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i, i % 2 ? SAGA_TOOL_VIEW : 0);
        gen_stream g, base, segment;
        player both, below, above;
        uint32_t n;

        gen_stream_make(&g, &o);
        base = base_alone(&g);
        segment = segment_alone(&g);
        play(&both, &g);
        play(&below, &base);
        play(&above, &segment);
        n = below.report.n_primitives;
        assert_int_equal(both.info.base_primitives, n);
        assert_int_equal(both.report.n_primitives,
                         n + above.report.n_primitives);
        for (uint32_t k = 0; k < both.report.n_primitives; k++)
            assert_same_primitive(&both, k, k < n ? &below : &above,
                                  k < n ? k : k - n, 1000);
        end(&both);
        end(&below);
        end(&above);
        gen_stream_free(&g);
    }
}

static saga_splat splat_at(const player *p, uint32_t order)
{
    saga_splat s;

    assert_int_equal(saga_splat_at(&s, p->dec, order), SAGA_OK);
    return s;
}

static void view(player *p)
{
    assert_int_equal(saga_view(p->dec, &p->camera, 0), SAGA_OK);
    assert_int_equal(saga_tell(&p->report, p->dec), SAGA_OK);
}

/* The base's first where depths are equal. */
TEST(both_should_be_drawn_in_one_order_of_depth)
{
    uint32_t n_seen[2] = { 0, 0 };

    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i, i % 2 ? SAGA_TOOL_VIEW : 0);
        gen_stream g, base, segment;
        player both, part[2];
        uint32_t at[2] = { 0, 0 };

        gen_stream_make(&g, &o);
        base = base_alone(&g);
        segment = segment_alone(&g);
        play(&both, &g);
        play(&part[0], &base);
        play(&part[1], &segment);
        view(&both);
        view(&part[0]);
        view(&part[1]);
        assert_int_equal(both.report.n_splats, part[0].report.n_splats +
                                               part[1].report.n_splats);
        for (uint32_t k = 0; k < both.report.n_splats; k++) {
            const saga_splat s = splat_at(&both, k);
            const int left[2] = { at[0] < part[0].report.n_splats,
                                  at[1] < part[1].report.n_splats };
            const int of = left[0] && left[1]
                ? splat_at(&part[0], at[0]).depth >
                  splat_at(&part[1], at[1]).depth : !left[0];
            const saga_splat want = splat_at(&part[of], at[of]++);

            n_seen[of]++;
            /* Padding follows the last field. */
            assert_memory_equal(&s, &want,
                                offsetof(saga_splat, y1) + sizeof s.y1);
        }
        end(&both);
        end(&part[0]);
        end(&part[1]);
        gen_stream_free(&g);
    }
    assert_true(n_seen[0] > 0 && n_seen[1] > 0);
}

static void check_still(const player *p, const saga_animated *first)
{
    static const int32_t times[] = { 0, 1, 32768, 65535 };
    saga_animated a;

    for (uint32_t k = 0; k < p->info.base_primitives; k++)
        for (size_t m = 0; m < sizeof times / sizeof *times; m++) {
            assert_int_equal(saga_primitive_at(&a, p->dec, k, times[m]),
                             SAGA_OK);
            assert_memory_equal(&a, &first[k], sizeof a);
        }
}

TEST(no_time_and_no_segment_should_change_the_base)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i, SAGA_TOOLS_PICTURE);
        saga_animated *first;
        gen_stream g;
        player p;

        gen_stream_make(&g, &o);
        play(&p, &g);
        first = must(calloc(p.info.base_primitives + 1u, sizeof *first));
        for (uint32_t k = 0; k < p.info.base_primitives; k++)
            assert_int_equal(saga_primitive_at(&first[k], p.dec, k, 12345),
                             SAGA_OK);
        check_still(&p, first);
        decode(&p, 1);
        check_still(&p, first);
        free(first);
        end(&p);
        gen_stream_free(&g);
    }
}

TEST(a_broken_segment_should_leave_the_base)
{
    const gen_options o = options_of(0, SAGA_TOOLS_PICTURE);
    saga_animated before, after;
    saga_segment seg;
    gen_stream g;
    player p;

    gen_stream_make(&g, &o);
    play(&p, &g);
    assert_int_equal(saga_primitive_at(&before, p.dec, 0, 0), SAGA_OK);
    assert_int_equal(saga_find(&seg, p.bytes, p.n, 0, 1), SAGA_OK);
    assert_int_equal(saga_decode(p.dec, &seg, p.bytes + seg.offset,
                                 seg.nbytes - 1, NULL), SAGA_ERR_TRUNCATED);
    assert_int_equal(saga_primitive_at(&after, p.dec, 0, 0), SAGA_ERR_STATE);
    decode(&p, 1);
    assert_int_equal(saga_primitive_at(&after, p.dec, 0, 0), SAGA_OK);
    assert_memory_equal(&before, &after, sizeof before);
    end(&p);
    gen_stream_free(&g);
}
