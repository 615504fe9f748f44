/* SPDX-License-Identifier: MIT
 *
 * Work is bounded. The slowest file of each level is accepted, and one step
 * beyond is refused with the header. A view that costs too much is refused
 * before it is drawn. A caller may stop the decoder, which can be used
 * afterwards.
 *
 * With SAGA_TEST_LONG the slowest files are decoded as a whole (a minute),
 * their times printed, and a deadline is tested.
 */
#include "gen_slow.h"
#include "player.h"
#include "saga.h"
#include "testing.h"

#include <time.h>

/* Returns by how much the number of anchors of the slowest files is divided
 * here: not at all at levels 0 and 1, at the others so that a file takes less
 * than a tenth of a second. Sanitizers take twenty times as long; with them it
 * is divided by a further 32. */
static uint32_t share_of(int level)
{
    static const uint32_t share[SAGA_N_PROFILES] = { 1, 1, 48, 1536 };
    const int slow = testing_sanitized();

    return testing_long() ? 1 : (slow ? 32 : 1) * share[level];
}

static double cpu_seconds(void)
{
    struct timespec t;

    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* --- A file -------------------------------------------------------------- */

static void load(player *f, gen_stream *g)
{
    player_load(f, g);
    assert_ok(saga_find(&f->seg, f->bytes, f->n, 0, 1));
}

static saga_status open_film(player *f, const saga_watch *watch)
{
    return saga_open(&f->dec, f->work, f->info.work_nbytes, f->bytes, f->n,
                     watch);
}

static saga_status decode(player *f, const saga_watch *watch)
{
    return saga_decode(f->dec, &f->seg, f->bytes + f->seg.offset, f->seg.nbytes,
                       watch);
}

/* --- Levels -------------------------------------------------------------- */

static uint64_t anchors_of(const saga_info *i)
{
    return (uint64_t)i->n_layers * (i->max_coarse + i->max_fine) +
           i->base_coarse + i->base_fine;
}

/* The slowest file's header as it stands, and with one anchor more. */
TEST(slowest_should_be_the_last_that_is_valid)
{
    for (int level = 0; level < SAGA_N_PROFILES; level++)
        for (int kind = 0; kind < GEN_N_SLOW; kind++) {
            const saga_level_caps *const cap = &saga_caps[level];
            FREED_BY(gen_stream_free) gen_stream g;
            saga_counts max;
            FREED_BY(player_close) player f;

            gen_slow_make(&g, level, kind, 4096);
            max = g.header.max;
            load(&f, &g);
            gen_slow_set_max(f.bytes, max.coarse, max.fine);
            assert_ok(saga_probe(&f.info, f.bytes, f.n));
            assert_int_equal(f.info.level, level);
            assert_true(f.info.work <= cap->work &&
                        anchors_of(&f.info) <= cap->n_anchors);
            assert_true(f.info.work > cap->work / 10 * 9 ||
                        anchors_of(&f.info) + 16 > cap->n_anchors);
            gen_slow_set_max(f.bytes, max.coarse + 1, max.fine + 1);
            assert_int_equal(saga_probe(&f.info, f.bytes, f.n), SAGA_ERR_LEVEL);
            assert_int_equal(open_film(&f, NULL), SAGA_ERR_LEVEL);
            assert_null(f.dec);
        }
}

TEST(slowest_should_decode)
{
    for (int level = 0; level < SAGA_N_PROFILES; level++)
        for (int kind = 0; kind < GEN_N_SLOW; kind++) {
            const uint32_t share = share_of(level);
            FREED_BY(gen_stream_free) gen_stream g;
            double begin;
            FREED_BY(player_close) player f;

            gen_slow_make(&g, level, kind, share);
            load(&f, &g);
            assert_ok(open_film(&f, NULL));
            begin = cpu_seconds();
            assert_ok(decode(&f, NULL));
            print_message("  level %d, kind %d: %zu bytes, 1/%u in %.3f s\n",
                          level, kind, f.n, share, cpu_seconds() - begin);
        }
}

/* --- Stopping ------------------------------------------------------------ */

/* A saga_watch that stops the decoder when it is asked for the `at`th time;
 * never if at is 0. */
typedef struct {
    uint32_t at, n_asked;
} patience;

static int ask(void *user)
{
    patience *const p = user;

    return ++p->n_asked == p->at;
}

static uint32_t digest(const player *f)
{
    const int32_t from[3] = { 3 << 22, -(1 << 23), 77 };
    saga_report r;
    uint32_t crc;

    assert_ok(saga_tell(&r, f->dec));
    crc = saga_crc32c(0, (const uint8_t *)&r, sizeof r);
    for (uint32_t i = 0; i < r.n_primitives; i++) {
        saga_animated a;
        uint16_t colour[3];

        assert_ok(saga_primitive_at(&a, f->dec, i, 20000));
        assert_ok(saga_colour_at(colour, f->dec, i, from));
        crc = saga_crc32c(crc, (const uint8_t *)&a, sizeof a);
        crc = saga_crc32c(crc, (const uint8_t *)colour, sizeof colour);
    }
    return crc;
}

/* Decoding that is stopped at the at-th call of the watch must leave no segment
 * and must not call the watch again. When the segment is decoded again, it must
 * be the same as before. */
static void stop_decoding(player *f, uint32_t at, uint32_t expected)
{
    patience p = { at, 0 };
    const saga_watch watch = { ask, &p };
    saga_report r;

    assert_int_equal(decode(f, &watch), SAGA_ERR_STOPPED);
    assert_int_equal(p.n_asked, at);
    assert_int_equal(saga_tell(&r, f->dec), SAGA_ERR_STATE);
    assert_ok(decode(f, NULL));
    assert_int_equal(p.n_asked, at);
    assert_int_equal(digest(f), expected);
}

static void stop_opening(player *f, uint32_t at, uint32_t expected)
{
    patience p = { at, 0 };
    const saga_watch watch = { ask, &p };

    assert_int_equal(open_film(f, &watch), SAGA_ERR_STOPPED);
    assert_null(f->dec);
    assert_int_equal(p.n_asked, at);
    assert_ok(open_film(f, NULL));
    assert_ok(decode(f, NULL));
    assert_int_equal(digest(f), expected);
}

enum { EARLY = 5, AT_RANDOM = 6 };

/* Stops the decoder at every early question, at the last one, and at some
 * between. */
static void stop_everywhere(gen_stream *g, uint64_t seed)
{
    patience opened = { 0, 0 }, decoded = { 0, 0 };
    const saga_watch opening = { ask, &opened }, decoding = { ask, &decoded };
    uint32_t expected;
    FREED_BY(player_close) player f;

    load(&f, g);
    assert_ok(open_film(&f, &opening));
    assert_ok(decode(&f, &decoding));
    assert_true(opened.n_asked > 0 && decoded.n_asked > 0);
    expected = digest(&f);
    for (uint32_t i = 1; i <= EARLY + 1 + AT_RANDOM; i++) {
        const uint32_t r = (uint32_t)gen_random(&seed);

        if (i > EARLY || i <= decoded.n_asked)
            stop_decoding(&f,
                          i <= EARLY       ? i
                          : i == EARLY + 1 ? decoded.n_asked
                                           : 1 + r % decoded.n_asked,
                          expected);
        if (i > EARLY || i <= opened.n_asked)
            stop_opening(&f,
                         i <= EARLY       ? i
                         : i == EARLY + 1 ? opened.n_asked
                                          : 1 + r % opened.n_asked,
                         expected);
    }
}

TEST(stopped_decoder_should_decode_again)
{
    gen_stream g;

    for (int i = 0; i < 12; i++) {
        const gen_options o = { .seed = 900 + (uint64_t)i,
                                .level = i % 4,
                                .n_coarse = 16,
                                .bank = i % 3,
                                .base = i % 2,
                                .n_layers = 1 + (uint32_t)i % 3,
                                .classes = i % 5 < 3 ? 0 : (uint32_t)i % 5 };

        g = gen_stream_make(&o);
        stop_everywhere(&g, o.seed);
        gen_stream_free(&g);
    }
    for (int i = 0; i < GEN_N_SLOW; i++) {
        gen_slow_make(&g, 0, i, testing_sanitized() ? 8 : 1);
        stop_everywhere(&g, (uint64_t)i);
        gen_stream_free(&g);
    }
}

/* A base that takes long is decoded in saga_open, which may be stopped too. */
TEST(opening_should_stop_within_the_base)
{
    patience p = { 0, 0 };
    const saga_watch watch = { ask, &p };
    FREED_BY(gen_stream_free) gen_stream g;
    FREED_BY(player_close) player f;

    gen_slow_make(&g, 1, GEN_SLOW_NARROW, 8);
    g.header.model.tools |= SAGA_TOOL_BASE;
    g.has_base = 1;
    g.base = g.segment[7];
    g.header.more_layers = 6;
    load(&f, &g);
    assert_ok(open_film(&f, &watch));
    assert_true(p.n_asked > 20);
    assert_ok(decode(&f, NULL));
    stop_opening(&f, p.n_asked / 2, digest(&f));
}

/* A saga_watch that stops the decoder when the time is over. */
static int is_late(void *user)
{
    return cpu_seconds() > *(const double *)user;
}

/* However the time is spent, the answer comes within 50 ms and a little; an
 * eighth of level 3's slowest are some seconds. */
TEST(deadline_should_be_kept)
{
    for (int level = 2; testing_long() && level < SAGA_N_PROFILES; level++)
        for (int kind = 0; kind < GEN_N_SLOW; kind++) {
            double deadline, late;
            const saga_watch watch = { is_late, &deadline };
            FREED_BY(gen_stream_free) gen_stream g;
            FREED_BY(player_close) player f;

            gen_slow_make(&g, level, kind, level == 2 ? 1 : 8);
            load(&f, &g);
            assert_ok(open_film(&f, NULL));
            deadline = cpu_seconds() + 0.05;
            assert_int_equal(decode(&f, &watch), SAGA_ERR_STOPPED);
            late = cpu_seconds() - deadline;
            print_message("  level %d, kind %d: %.2f ms late\n", level, kind,
                          1e3 * late);
            assert_true(late < 0.01);
        }
}

/* --- Pictures ------------------------------------------------------------ */

enum { SIDE = 256 };

static saga_status draw(const player *f, const saga_camera *c)
{
    uint32_t crc;

    return player_draw(&crc, f->dec, c);
}

static void see_wall(player *f, saga_camera *c, int level, uint32_t n)
{
    uint32_t number;
    FREED_BY(gen_stream_free) gen_stream g;

    gen_slow_wall(&g, level, n);
    load(f, &g);
    assert_int_equal(f->info.level, level);
    assert_ok(open_film(f, NULL));
    assert_ok(decode(f, NULL));
    assert_ok(saga_rig(c, &number, f->bytes, f->n, 0));
    assert_int_equal(c->width, SIDE);
}

/* As many splats as a view may have that all cover it, and one more. */
TEST(view_should_cost_what_the_level_allows)
{
    for (int level = 0; level < SAGA_N_PROFILES; level++) {
        const uint32_t most = SAGA_COVER_MAX(level);
        saga_camera c;
        saga_report r;
        player f;

        see_wall(&f, &c, level, most);
        assert_ok(saga_tell(&r, f.dec));
        assert_int_equal(r.box_pixels, 0);
        assert_ok(saga_view(f.dec, &c, 0));
        assert_ok(saga_tell(&r, f.dec));
        assert_int_equal(r.n_splats, most);
        assert_int_equal(r.box_pixels, (uint64_t)most * SIDE * SIDE);
        player_close(&f);
        see_wall(&f, &c, level, most + 1);
        assert_int_equal(saga_view(f.dec, &c, 0), SAGA_ERR_LEVEL);
        assert_ok(saga_tell(&r, f.dec));
        assert_int_equal(r.n_splats, 0);
        assert_int_equal(r.box_pixels, (most + 1ull) * SIDE * SIDE);
        assert_int_equal(draw(&f, &c), SAGA_ERR_STATE);
        player_close(&f);
    }
}

/* A picture of fewer pixels than 65,536 may be covered more often. A view that
 * is refused ends the one before, whose job cannot go on. */
TEST(refused_view_should_leave_none)
{
    saga_camera c;
    saga_report r;
    FREED_BY(player_close) player f;

    see_wall(&f, &c, 0, SAGA_COVER_MAX(0) + 1);
    c.height--;
    assert_ok(saga_view(f.dec, &c, 0));
    assert_ok(draw(&f, &c));
    c.height++;
    assert_int_equal(saga_view(f.dec, &c, 0), SAGA_ERR_LEVEL);
    assert_int_equal(draw(&f, &c), SAGA_ERR_STATE);
    c.height /= 2;
    assert_ok(saga_view(f.dec, &c, 0));
    assert_ok(saga_tell(&r, f.dec));
    assert_int_equal(r.box_pixels, (uint64_t)r.n_splats * SIDE * SIDE / 2);
    assert_ok(draw(&f, &c));
}
