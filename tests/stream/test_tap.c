/* SPDX-License-Identifier: MIT
 *
 * Splats that are read in bulk must equal splats that are read one by one, for
 * every range of indices, and nothing outside of the buffer must be written.
 */
#include "model.h"
#include "player.h"
#include "testing.h"

enum { CANARY = 0x5a };

static void make(player *p, uint64_t seed, uint32_t tools)
{
    const gen_options o = { .seed = seed,
                            .level = 1,
                            .n_coarse = 8,
                            .picture = 1,
                            .tools_fixed = 1,
                            .tools = tools };

    player_make(p, &o);
}

/* Makes the view at time t; returns its number of splats. */
static uint32_t view(player *p, int32_t t)
{
    assert_ok(saga_view(p->dec, &p->camera, t));
    assert_ok(saga_tell(&p->report, p->dec));
    return p->report.n_splats;
}

static void assert_same(const saga_splat *a, const saga_splat *b)
{
    assert_memory_equal(a, b, offsetof(saga_splat, y1) + sizeof a->y1);
}

static int is_untouched(const saga_splat *s)
{
    const uint8_t *const p = (const uint8_t *)s;

    for (size_t i = 0; i < sizeof *s; i++)
        if (p[i] != CANARY)
            return 0;
    return 1;
}

/* Takes the splats [first, first + n), with room for one more splat before and
 * after them. */
static void check_part(const player *f, uint32_t first, uint32_t n)
{
    FREED saga_splat *const all = malloc(((size_t)n + 2) * sizeof *all);
    saga_splat one;

    assert_non_null(all);
    memset(all, CANARY, ((size_t)n + 2) * sizeof *all);
    assert_ok(saga_splats_at(all + 1, f->dec, first, n));
    assert_true(is_untouched(all) && is_untouched(all + n + 1));
    for (uint32_t i = 0; i < n; i++) {
        assert_int_equal(saga_splat_at(&one, f->dec, first + i), SAGA_OK);
        assert_same(all + 1 + i, &one);
    }
}

TEST(tap_should_give_what_single_splats_are)
{
    uint32_t most = 0;

    for (uint32_t seed = 1; seed <= 24; seed++) {
        FREED_BY(player_close) player f;
        uint32_t n;

        make(&f, seed, seed * 5 % 32 | (seed & 1) * SAGA_TOOL_STEEP);
        player_decode(&f, 0);
        n = view(&f, (int32_t)(seed * 2621));
        most = n > most ? n : most;
        check_part(&f, 0, n);
        check_part(&f, n / 3, n / 2);
        check_part(&f, n, 0);
        check_part(&f, 0, 0);
    }
    assert_true(most > 100);
}

/* The camera looks away from everything: a view, but of no splats. */
static void turn_away(player *f)
{
    for (int i = 0; i < 3; i++)
        f->camera.centre[i] = 1 << 29;
    f->camera.near_plane = INT32_MAX;
}

TEST(tap_should_refuse_what_is_not_there)
{
    saga_splat s;
    uint32_t n;
    FREED_BY(player_close) player f;

    memset(&s, CANARY, sizeof s);
    make(&f, 3, 0);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_ERR_STATE);
    player_decode(&f, 0);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_ERR_STATE);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 1), SAGA_ERR_STATE);
    n = view(&f, 0);
    assert_true(n > 1);
    assert_int_equal(saga_splats_at(&s, f.dec, n, 1), SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, n + 1, 0), SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, 1, n), SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, 2, UINT32_MAX - 1),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, UINT32_MAX, 2), SAGA_ERR_ARG);
    turn_away(&f);
    assert_int_equal(view(&f, 0), 0);
    assert_ok(saga_splats_at(&s, f.dec, 0, 0));
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 1), SAGA_ERR_ARG);
    player_decode(&f, 0);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_ERR_STATE);
    assert_true(is_untouched(&s));
}
