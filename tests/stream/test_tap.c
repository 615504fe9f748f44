/* SPDX-License-Identifier: MIT
 *
 * Splats in bulk: the same as one by one, wherever the caller begins and ends,
 * and nothing beside them.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "gen_stream.h"
#include "model.h"
#include "saga.h"

#include <stdlib.h>
#include <string.h>

enum { CANARY = 0x5a };

typedef struct {
    uint8_t *bytes, *work;
    size_t n;
    saga_info info;
    saga_decoder *dec;
    saga_camera camera;
} film;

static void film_open(film *f, uint64_t seed, uint32_t tools)
{
    const gen_options o = { .seed = seed, .level = 1, .n_coarse = 8,
                            .picture = 1, .tools_fixed = 1, .tools = tools };
    gen_stream g;
    uint32_t number;

    gen_stream_make(&g, &o);
    gen_stream_encode(&g, &f->bytes, &f->n);
    gen_stream_free(&g);
    assert_int_equal(saga_probe(&f->info, f->bytes, f->n), SAGA_OK);
    f->work = aligned_alloc(SAGA_WORK_ALIGN, f->info.work_nbytes);
    assert_non_null(f->work);
    assert_int_equal(saga_open(&f->dec, f->work, f->info.work_nbytes, f->bytes,
                               f->n, NULL), SAGA_OK);
    assert_int_equal(saga_rig(&f->camera, &number, f->bytes, f->n, 0), SAGA_OK);
}

static void film_decode(film *f)
{
    saga_segment seg;

    assert_int_equal(saga_find(&seg, f->bytes, f->n, 0, 1), SAGA_OK);
    assert_int_equal(saga_decode(f->dec, &seg, f->bytes + seg.offset,
                                 seg.nbytes, NULL), SAGA_OK);
}

static void film_close(film *f)
{
    free(f->work);
    free(f->bytes);
}

/* Number of splats that time t has. */
static uint32_t film_view(film *f, int32_t t)
{
    saga_report report;

    assert_int_equal(saga_view(f->dec, &f->camera, t), SAGA_OK);
    assert_int_equal(saga_tell(&report, f->dec), SAGA_OK);
    return report.n_splats;
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

/* Takes [first, first + n), one splat of room before and behind it. */
static void check_part(const film *f, uint32_t first, uint32_t n)
{
    saga_splat *const all = malloc(((size_t)n + 2) * sizeof *all);
    saga_splat one;

    assert_non_null(all);
    memset(all, CANARY, ((size_t)n + 2) * sizeof *all);
    assert_int_equal(saga_splats_at(all + 1, f->dec, first, n), SAGA_OK);
    assert_true(is_untouched(all) && is_untouched(all + n + 1));
    for (uint32_t i = 0; i < n; i++) {
        assert_int_equal(saga_splat_at(&one, f->dec, first + i), SAGA_OK);
        assert_same(all + 1 + i, &one);
    }
    free(all);
}

static void tap_should_give_what_single_splats_are(void **state)
{
    uint32_t most = 0;

    (void)state;
    for (uint32_t seed = 1; seed <= 24; seed++) {
        film f;
        uint32_t n;

        film_open(&f, seed, seed * 5 % 32 | (seed & 1) * SAGA_TOOL_STEEP);
        film_decode(&f);
        n = film_view(&f, (int32_t)(seed * 2621));
        most = n > most ? n : most;
        check_part(&f, 0, n);
        check_part(&f, n / 3, n / 2);
        check_part(&f, n, 0);
        check_part(&f, 0, 0);
        film_close(&f);
    }
    assert_true(most > 100);
}

/* The camera looks away from everything: a view, but of no splats. */
static void turn_away(film *f)
{
    for (int i = 0; i < 3; i++)
        f->camera.centre[i] = 1 << 29;
    f->camera.near_plane = INT32_MAX;
}

static void tap_should_refuse_what_is_not_there(void **state)
{
    saga_splat s;
    uint32_t n;
    film f;

    (void)state;
    memset(&s, CANARY, sizeof s);
    film_open(&f, 3, 0);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_ERR_STATE);
    film_decode(&f);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_ERR_STATE);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 1), SAGA_ERR_STATE);
    n = film_view(&f, 0);
    assert_true(n > 1);
    assert_int_equal(saga_splats_at(&s, f.dec, n, 1), SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, n + 1, 0), SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, 1, n), SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, 2, UINT32_MAX - 1),
                     SAGA_ERR_ARG);
    assert_int_equal(saga_splats_at(&s, f.dec, UINT32_MAX, 2), SAGA_ERR_ARG);
    turn_away(&f);
    assert_int_equal(film_view(&f, 0), 0);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_OK);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 1), SAGA_ERR_ARG);
    film_decode(&f);
    assert_int_equal(saga_splats_at(&s, f.dec, 0, 0), SAGA_ERR_STATE);
    assert_true(is_untouched(&s));
    film_close(&f);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(tap_should_give_what_single_splats_are),
        cmocka_unit_test(tap_should_refuse_what_is_not_there),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
