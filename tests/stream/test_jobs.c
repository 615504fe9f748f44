/* SPDX-License-Identifier: MIT
 *
 * Whole streams are decoded and drawn. The picture must not depend on jobs,
 * threads and calls, nor on the address of the work block; test_raster_jobs has
 * all divisions of a picture.
 */
#include "player.h"
#include "testing.h"

#include <pthread.h>

enum { N_STREAMS = 4, LARGE = 4 << 20, CANARY = 0xa5 };

/* --- Streams with a view ------------------------------------------------- */

/* Decodes the segment that was found, and makes its view. */
static void show(player *s)
{
    assert_ok(saga_decode(s->dec, &s->seg, s->bytes + s->seg.offset,
                          s->seg.nbytes, NULL));
    assert_ok(saga_view(s->dec, &s->camera, s->seg.t));
}

static void make_scene(player *s, const gen_options *o)
{
    player_make(s, o);
    assert_ok(saga_find(&s->seg, s->bytes, s->n, 1, 3));
    show(s);
}

static gen_options options_of(uint32_t i)
{
    const gen_options o = { .seed = testing_seed(1) + 10 + i,
                            .level = i % 2,
                            .n_coarse = 16,
                            .picture = 1,
                            .tools_fixed = 1,
                            .tools = (31 + 9 * i) % 32 };

    return o;
}

static uint32_t crc_of(const player *s)
{
    uint32_t crc;

    assert_ok(player_draw(&crc, s->dec, &s->camera));
    return crc;
}

/* --- Threads ------------------------------------------------------------- */

/* A job for a few rows of a picture, and what one call may do of it. */
typedef struct {
    const saga_decoder *dec;
    saga_job job;
    saga_picture picture;
    uint32_t budget;
    saga_status status;
} band;

/* Makes the i-th of n bands of a picture of a scene. */
static void make_band(band *b, const player *s, uint8_t *rgb, uint32_t i,
                      uint32_t n)
{
    const size_t line = 3u * s->camera.width;
    saga_job *const job = &b->job;

    memset(b, 0, sizeof *b);
    b->dec = s->dec;
    b->budget = 50 + i;
    b->status = SAGA_AGAIN;
    job->x1 = s->camera.width;
    job->y0 = (int32_t)(s->camera.height * i / n);
    job->y1 = (int32_t)(s->camera.height * (i + 1) / n);
    job->tile = 8 << i % 4;
    job->list_capacity = 37 + i;
    job->scratch_nbytes = SAGA_JOB_NBYTES(job->tile, job->list_capacity);
    job->scratch = must(malloc(job->scratch_nbytes));
    b->picture.rgb = rgb + (size_t)job->y0 * line;
    b->picture.stride_nbytes = line;
    b->picture.nbytes = (size_t)(job->y1 - job->y0) * line;
    b->picture.bits = 8;
}

static void *draw_band(void *arg)
{
    band *const b = arg;

    while (b->status == SAGA_AGAIN)
        b->status = saga_draw(b->dec, &b->job, &b->picture, b->budget);
    return NULL;
}

/* Draws a picture in n bands, each in a thread of its own, or all in turns if
 * !threads. Finished jobs are called again. */
static void check_bands(const player *s, uint32_t n, int threads)
{
    const size_t all = 3u * s->camera.width * (size_t)s->camera.height;
    FREED uint8_t *const p = must(malloc(all));
    pthread_t thread[8];
    band b[8];
    uint32_t left = n;

    for (uint32_t i = 0; i < n; i++)
        make_band(&b[i], s, p, i, n);
    for (uint32_t i = 0; threads && i < n; i++)
        assert_int_equal(pthread_create(&thread[i], NULL, draw_band, &b[i]), 0);
    for (uint32_t i = 0; threads && i < n; i++)
        assert_int_equal(pthread_join(thread[i], NULL), 0);
    for (uint32_t i = 0; !threads && left > 0; i = (i + 1) % n) {
        const saga_status before = b[i].status;

        b[i].status = saga_draw(s->dec, &b[i].job, &b[i].picture, 50);
        assert_true(b[i].status == SAGA_OK || before == SAGA_AGAIN);
        left -= before != SAGA_OK && b[i].status == SAGA_OK;
    }
    for (uint32_t i = 0; i < n; i++) {
        assert_ok(b[i].status);
        free(b[i].job.scratch);
    }
    assert_int_equal(saga_crc32c(0, p, all), crc_of(s));
}

TEST(threads_and_turns_should_draw_what_one_job_draws)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        FREED_BY(player_close) player s;

        make_scene(&s, &o);
        for (uint32_t k = 0; k < 8; k++) {
            check_bands(&s, 1, 1);
            check_bands(&s, 4, 1);
            check_bands(&s, 7, 1);
        }
        check_bands(&s, 5, 0);
    }
}

/* --- Blocks -------------------------------------------------------------- */

/* The work block may be the static one of level 0, 256 KiB, or far larger than
 * needed. */
TEST(picture_should_not_depend_on_the_block)
{
    static _Alignas(SAGA_WORK_ALIGN) uint8_t level_0[SAGA_WORK_MAX(0)];

    for (uint32_t i = 0; i < N_STREAMS; i += 2) {
        const gen_options o = options_of(i);
        player exact, large, fixed;
        uint32_t crc;

        make_scene(&exact, &o);
        large = exact;
        large.work = must(aligned_alloc(SAGA_WORK_ALIGN, LARGE));
        assert_ok(saga_open(&large.dec, large.work, LARGE, large.bytes, large.n,
                            NULL));
        show(&large);
        crc = crc_of(&exact);
        assert_int_equal(crc_of(&large), crc);
        fixed = exact;
        memset(level_0, CANARY, sizeof level_0);
        memcpy(level_0, exact.work, exact.info.work_nbytes);
        fixed.dec = (saga_decoder *)(void *)level_0;
        assert_int_equal(crc_of(&fixed), crc);
        assert_ok(saga_open(&fixed.dec, level_0, sizeof level_0, exact.bytes,
                            exact.n, NULL));
        free(large.work);
        player_close(&exact);
    }
}

typedef struct {
    saga_job job;
    saga_picture picture;
} call;
