/* SPDX-License-Identifier: MIT
 *
 * Functions that a program calls between decoding and drawing: they tell what
 * the views tell, refuse wrong arguments and calls out of order, and refuse
 * files that are cut anywhere.
 */
#include "player.h"
#include "project.h"
#include "testing.h"

static const gen_options options = { .seed = 12,
                                     .level = 1,
                                     .n_coarse = 10,
                                     .picture = 1,
                                     .tools_fixed = 1,
                                     .tools = SAGA_TOOLS_PICTURE,
                                     .n_segments = 2 };

/* --- Colours ------------------------------------------------------------- */

typedef struct {
    uint32_t depth, index;
} seen;

static int nearer(const void *a, const void *b)
{
    const seen *const p = a, *const q = b;

    return p->depth != q->depth  ? (p->depth < q->depth ? -1 : 1)
           : p->index < q->index ? -1
                                 : p->index > q->index;
}

/* Lists the primitives that a camera sees, in drawing order. */
static uint32_t see_all(seen *list, const player *p, const saga_camera *c,
                        int32_t t)
{
    saga_report report;
    saga_animated a;
    saga_splat s;
    uint32_t n = 0;

    assert_ok(saga_tell(&report, p->dec));
    for (uint32_t i = 0; i < report.n_primitives; i++) {
        assert_ok(saga_primitive_at(&a, p->dec, i, t));
        if (saga_project(&s, &a, c, 0))
            list[n++] = (seen){ s.depth, i };
    }
    qsort(list, n, sizeof *list, nearer);
    assert_int_equal(n, report.n_splats);
    return n;
}

static void check_colours(uint32_t tools)
{
    const int32_t t = 20000;
    gen_options o = options;
    FREED_BY(player_close) player p;
    saga_camera c;
    FREED seen *list;
    FREED saga_splat *made;
    FREED uint32_t *index;
    FREED int32_t(*middle)[3];
    uint32_t crc, again, n;

    o.tools = tools;
    player_make(&p, &o);
    list = must(malloc(p.info.max_primitives * sizeof *list));
    player_decode(&p, 0);
    player_view(&p, 1, t);
    c = p.camera;
    assert_ok(player_draw(&crc, p.dec, &c));
    n = see_all(list, &p, &c, t);
    assert_true(n > 5);
    made = must(malloc(n * sizeof *made));
    index = must(malloc(n * sizeof *index));
    middle = must(malloc(n * sizeof *middle));
    for (uint32_t i = 0; i < n; i++) {
        saga_animated a;

        index[i] = list[i].index;
        assert_ok(saga_primitive_at(&a, p.dec, index[i], 32768));
        memcpy(middle[i], a.x, sizeof a.x);
    }
    for (int given = 0; given < 2; given++) {
        memset(made, 1, n * sizeof *made);
        assert_ok(saga_colours_at(made, p.dec, index, n, c.centre,
                                  given ? (const int32_t(*)[3])middle : NULL));
        for (uint32_t i = 0; i < n; i++) {
            uint16_t colour[3];
            saga_splat s;

            assert_ok(saga_colour_at(colour, p.dec, list[i].index, c.centre));
            assert_ok(saga_splat_at(&s, p.dec, i));
            assert_memory_equal(colour, s.colour_q15, sizeof colour);
            assert_memory_equal(made[i].colour_q15, colour, sizeof colour);
        }
    }
    /* One position beyond 2^29, or one primitive that is not there, spoils all.
     */
    memset(made, 1, n * sizeof *made);
    middle[n - 1][2] = -(1 << 29) - 1;
    assert_int_equal(saga_colours_at(made, p.dec, index, n, c.centre,
                                     (const int32_t(*)[3])middle),
                     SAGA_ERR_ARG);
    index[n - 1] = p.info.max_primitives + p.info.base_primitives;
    assert_int_equal(saga_colours_at(made, p.dec, index, n, c.centre, NULL),
                     SAGA_ERR_ARG);
    assert_int_equal(made[0].colour_q15[0], 257);
    assert_ok(player_draw(&again, p.dec, &c));
    assert_int_equal(again, crc);
}

TEST(colour_should_be_that_of_a_view_from_there)
{
    check_colours(SAGA_TOOLS_PICTURE | SAGA_TOOL_VIEW);
    check_colours(SAGA_TOOLS_PICTURE & ~(uint32_t)SAGA_TOOL_VIEW);
}

TEST(colour_of_what_is_not_there_should_be_refused)
{
    const int32_t edge[3] = { 1 << 29, -(1 << 29), 0 };
    int32_t beyond[3] = { 0, 0, (1 << 29) + 1 };
    uint16_t colour[3];
    saga_report report;
    FREED_BY(player_close) player p;

    player_make(&p, &options);
    assert_int_equal(saga_colour_at(colour, p.dec, 0, edge), SAGA_ERR_STATE);
    player_decode(&p, 0);
    assert_ok(saga_tell(&report, p.dec));
    assert_ok(saga_colour_at(colour, p.dec, 0, edge));
    assert_int_equal(saga_colour_at(colour, p.dec, report.n_primitives, edge),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_colour_at(colour, p.dec, 0, beyond), SAGA_ERR_ARG);
    beyond[2] = -beyond[2];
    assert_int_equal(saga_colour_at(colour, p.dec, 0, beyond), SAGA_ERR_ARG);
}

/* --- Visible primitives -------------------------------------------------- */

/* Checks that all visible primitives at time t are found, n at a time, as
 * saga_primitive_at computes them. Returns the number of those that are not
 * visible. */
static uint32_t check_visible(const saga_decoder *dec, uint32_t n, int32_t t)
{
    uint32_t invisible = 0;
    saga_report report;

    assert_ok(saga_tell(&report, dec));
    for (uint32_t i = 0; i < report.n_primitives; i += n) {
        const uint32_t left = report.n_primitives - i;
        saga_visible got[8];
        uint32_t n_got, k = 0;

        assert_true(n <= 8);
        assert_ok(saga_visible_at(got, &n_got, dec, i, left < n ? left : n, t));
        for (uint32_t j = i; j < i + (left < n ? left : n); j++) {
            saga_animated a;

            assert_ok(saga_primitive_at(&a, dec, j, t));
            if (a.q0_q20 >= 11 << 20) {
                invisible++;
                continue;
            }
            assert_true(k < n_got);
            assert_int_equal(got[k].index, j);
            assert_memory_equal(&got[k].at, &a, sizeof a);
            k++;
        }
        assert_int_equal(k, n_got);
    }
    return invisible;
}

TEST(visible_primitives_should_be_those_that_are_drawn)
{
    FREED_BY(player_close) player p;
    saga_visible got[8];
    saga_report report;
    uint32_t n_got = 7, invisible = 0;

    player_make(&p, &options);
    assert_int_equal(saga_visible_at(got, &n_got, p.dec, 0, 0, 0),
                     SAGA_ERR_STATE);
    player_decode(&p, 0);
    assert_ok(saga_tell(&report, p.dec));
    for (int32_t t = 0; t < 65536; t += 13107) {
        invisible += check_visible(p.dec, 8, t);
        invisible += check_visible(p.dec, 1, t);
    }
    assert_true(invisible > 0);
    assert_int_equal(
        saga_visible_at(got, &n_got, p.dec, report.n_primitives - 1, 2, 0),
        SAGA_ERR_ARG);
    assert_int_equal(
        saga_visible_at(got, &n_got, p.dec, report.n_primitives + 1, 0, 0),
        SAGA_ERR_ARG);
    assert_int_equal(saga_visible_at(got, &n_got, p.dec, 0, 1, 65536),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_visible_at(got, &n_got, p.dec, 0, 1, -1),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_primitive_at(&got[0].at, p.dec, 0, 65536),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_primitive_at(&got[0].at, p.dec, 0, -1), SAGA_ERR_ARG);
    assert_int_equal(n_got, 7);
    assert_ok(saga_visible_at(got, &n_got, p.dec, report.n_primitives, 0, 0));
    assert_int_equal(n_got, 0);
}

/* --- Order of calls ------------------------------------------------------ */

/* Checks that calls that need a decoded segment are refused. */
static void assert_nothing_decoded(saga_decoder *dec, const saga_camera *c)
{
    saga_report report;
    saga_animated a;
    saga_splat s;
    uint32_t crc;

    assert_int_equal(saga_tell(&report, dec), SAGA_ERR_STATE);
    assert_int_equal(saga_primitive_at(&a, dec, 0, 0), SAGA_ERR_STATE);
    assert_int_equal(saga_view(dec, c, 0), SAGA_ERR_STATE);
    assert_int_equal(saga_splat_at(&s, dec, 0), SAGA_ERR_STATE);
    assert_int_equal(player_draw(&crc, dec, c), SAGA_ERR_STATE);
}

static void assert_no_view(const saga_decoder *dec, const saga_camera *c)
{
    saga_report report;
    saga_splat s;
    uint32_t crc;

    assert_ok(saga_tell(&report, dec));
    assert_int_equal(report.n_splats, 0);
    assert_int_equal(saga_splat_at(&s, dec, 0), SAGA_ERR_STATE);
    assert_int_equal(player_draw(&crc, dec, c), SAGA_ERR_STATE);
}

TEST(calls_out_of_order_should_be_refused)
{
    FREED_BY(player_close) player p;
    saga_segment seg;
    uint32_t crc;

    player_make(&p, &options);
    assert_nothing_decoded(p.dec, &p.camera);
    player_decode(&p, 0);
    assert_no_view(p.dec, &p.camera);
    player_view(&p, 0, 0);
    assert_int_not_equal(p.report.n_splats, 0);
    assert_ok(player_draw(&crc, p.dec, &p.camera));
    player_decode(&p, 0);
    assert_no_view(p.dec, &p.camera);
    player_view(&p, 0, 0);
    seg = player_find(&p, 0);
    assert_int_equal(saga_decode(p.dec, &seg, p.bytes + seg.offset, 1, NULL),
                     SAGA_ERR_TRUNCATED);
    assert_nothing_decoded(p.dec, &p.camera);
    player_decode(&p, 1);
    p.bytes[p.n - 1] ^= 1;
    seg = player_find(&p, 1);
    assert_int_equal(
        saga_decode(p.dec, &seg, p.bytes + seg.offset, seg.nbytes, NULL),
        SAGA_ERR_DATA);
    assert_nothing_decoded(p.dec, &p.camera);
}

/* Every length a segment may be cut to. */
TEST(cut_segment_should_be_refused)
{
    const gen_options o = {
        .seed = 3, .level = 0, .n_coarse = 2, .tools_fixed = 1
    };
    FREED_BY(player_close) player p;
    saga_segment seg;

    player_make(&p, &o);
    assert_ok(saga_find(&seg, p.bytes, p.n, 0, 1));
    for (size_t n = 0; n < seg.nbytes; n++) {
        FREED uint8_t *const copy = must(malloc(n ? n : 1));

        memcpy(copy, p.bytes + seg.offset, n);
        assert_int_equal(saga_decode(p.dec, &seg, copy, n, NULL),
                         SAGA_ERR_TRUNCATED);
    }
}
