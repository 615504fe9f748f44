/* SPDX-License-Identifier: MIT
 *
 * Whole streams are decoded and drawn. The picture must not depend on its
 * division into tiles, lists, bands, jobs, threads and calls, nor on the
 * address of the work block.
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

/* --- Drawing ------------------------------------------------------------- */

/* The division of a picture. */
typedef struct {
    int32_t tile;
    uint32_t list;
    uint32_t n_tiles; /* approximate number of tiles for which the
                       * scratch has room */
    uint32_t budget;
    int bits;
} division;

static const division plain = { 16, 500, 1, 1u << 30, 8 };

static size_t scratch_nbytes(const division *d)
{
    const size_t tile = (size_t)d->tile * (size_t)d->tile * 16 + 8;

    return SAGA_JOB_NBYTES(d->tile, d->list) + (d->n_tiles - 1) * tile;
}

/* Draws a rectangle, whose rows begin at `rows`. */
static void draw_rect(const player *s, const division *d, int32_t x0,
                      int32_t y0, int32_t x1, int32_t y1,
                      const saga_picture *picture)
{
    saga_status status;
    saga_job job = { .x0 = x0,
                     .y0 = y0,
                     .x1 = x1,
                     .y1 = y1,
                     .tile = d->tile,
                     .list_capacity = d->list };

    job.scratch_nbytes = scratch_nbytes(d);
    job.scratch = malloc(job.scratch_nbytes);
    if (!job.scratch)
        abort();
    do
        status = saga_draw(s->dec, &job, picture, d->budget);
    while (status == SAGA_AGAIN);
    free(job.scratch);
    if (status != SAGA_OK)
        abort(); /* also called by threads */
}

static size_t line_nbytes(const player *s, const division *d)
{
    return 3u * s->camera.width * (d->bits == 16 ? 2u : 1u);
}

/* Draws the whole picture into memory of exact size, which the caller frees. */
static uint8_t *draw(const player *s, const division *d)
{
    const size_t line = line_nbytes(s, d), n = line * s->camera.height;
    uint8_t *const p = must(malloc(n));
    const saga_picture picture = { p, line, n, d->bits };

    draw_rect(s, d, 0, 0, s->camera.width, s->camera.height, &picture);
    return p;
}

static uint32_t crc_of(const player *s, const division *d)
{
    FREED uint8_t *const p = draw(s, d);
    const uint32_t crc = saga_crc32c(0, p,
                                     line_nbytes(s, d) * s->camera.height);

    return crc;
}

/* --- Divisions ----------------------------------------------------------- */

static void check_divisions(const player *s)
{
    static const int32_t tiles[] = { 8, 16, 32, 64 };
    static const uint32_t lists[] = { 1, 37, 4000 };
    static const uint32_t bands[] = { 1, 3, 7, 10000 };
    const uint32_t crc = crc_of(s, &plain);

    for (uint32_t i = 0; i < 4; i++)
        for (uint32_t k = 0; k < 3; k++)
            for (uint32_t b = 0; b < 4; b++) {
                const division d = { tiles[i], lists[k], bands[b], 1u << 30,
                                     8 };

                assert_int_equal(crc_of(s, &d), crc);
            }
}

static void check_budgets(const player *s)
{
    static const uint32_t budgets[] = { 1, 2, 7, 100, 4096, 0xffffffffu };
    const uint32_t crc = crc_of(s, &plain);

    for (uint32_t i = 0; i < 6; i++) {
        const division d = { 32, 37, 2, budgets[i], 8 };

        assert_int_equal(crc_of(s, &d), crc);
    }
}

/* Checks that a picture shows something, so that comparing it is useful. */
static void assert_is_picture(const player *s)
{
    uint8_t *const p = draw(s, &plain);
    const size_t n = line_nbytes(s, &plain) * s->camera.height;
    uint32_t other = 0;

    for (size_t i = 3; i < n; i++)
        other += p[i] != p[i - 3];
    free(p);
    assert_true(other > n / 100);
}

TEST(picture_should_not_depend_on_its_division)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        FREED_BY(player_close) player s;

        make_scene(&s, &o);
        if (testing_seed(1) == 1)
            assert_is_picture(&s);
        check_divisions(&s);
        check_budgets(&s);
    }
}

/* --- Threads ------------------------------------------------------------- */

typedef struct {
    const player *s;
    division d;
    int32_t y0, y1;
    saga_picture picture;
} band;

static void *draw_band(void *arg)
{
    const band *const b = arg;

    draw_rect(b->s, &b->d, 0, b->y0, b->s->camera.width, b->y1, &b->picture);
    return NULL;
}

static uint32_t crc_of_threads(const player *s, uint32_t n)
{
    const size_t line = line_nbytes(s, &plain), all = line * s->camera.height;
    FREED uint8_t *const p = must(malloc(all));
    pthread_t thread[8];
    band job[8];
    uint32_t crc;

    for (uint32_t i = 0; i < n; i++) {
        band *const b = &job[i];

        b->s = s;
        b->d = plain;
        b->d.tile = 8 << i % 4;
        b->d.list = 37 + i;
        b->d.budget = 100 + i;
        b->y0 = (int32_t)(s->camera.height * i / n);
        b->y1 = (int32_t)(s->camera.height * (i + 1) / n);
        b->picture.rgb = p + (size_t)b->y0 * line;
        b->picture.stride_nbytes = line;
        b->picture.nbytes = (size_t)(b->y1 - b->y0) * line;
        b->picture.bits = 8;
        assert_int_equal(pthread_create(&thread[i], NULL, draw_band, b), 0);
    }
    for (uint32_t i = 0; i < n; i++)
        assert_int_equal(pthread_join(thread[i], NULL), 0);
    crc = saga_crc32c(0, p, all);
    return crc;
}

TEST(threads_should_draw_what_one_draws)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        FREED_BY(player_close) player s;
        uint32_t crc;

        make_scene(&s, &o);
        crc = crc_of(&s, &plain);
        for (uint32_t k = 0; k < 8; k++) {
            assert_int_equal(crc_of_threads(&s, 1), crc);
            assert_int_equal(crc_of_threads(&s, 4), crc);
            assert_int_equal(crc_of_threads(&s, 7), crc);
        }
    }
}

/* Several jobs that advance in turns on one thread, and a job that is begun
 * again, must all give the same pixels. */
TEST(jobs_should_not_disturb_each_other)
{
    enum { N = 5 };
    const gen_options o = options_of(1);
    const division d = { 16, 37, 1, 50, 8 };
    saga_job job[N];
    int left = N, done[N] = { 0 };
    FREED_BY(player_close) player s;
    FREED uint8_t *p;
    size_t line, n;

    make_scene(&s, &o);
    line = line_nbytes(&s, &d);
    n = line * s.camera.height;
    p = must(malloc(n));
    memset(job, 0, sizeof job);
    for (int i = 0; i < N; i++) {
        job[i].x1 = s.camera.width;
        job[i].y0 = s.camera.height * i / N;
        job[i].y1 = s.camera.height * (i + 1) / N;
        job[i].tile = d.tile;
        job[i].list_capacity = d.list;
        job[i].scratch_nbytes = scratch_nbytes(&d);
        job[i].scratch = must(malloc(job[i].scratch_nbytes));
    }
    for (int i = 0; left > 0; i = (i + 1) % N) {
        const size_t from = (size_t)job[i].y0 * line;
        const saga_picture picture = { p + from, line, n - from, 8 };
        const saga_status status = saga_draw(s.dec, &job[i], &picture, 50);

        assert_true(status == SAGA_OK || (status == SAGA_AGAIN && !done[i]));
        if (status == SAGA_OK && !done[i]) {
            done[i] = 1;
            left--;
        }
    }
    assert_int_equal(saga_crc32c(0, p, n), crc_of(&s, &plain));
    for (int i = 0; i < N; i++)
        free(job[i].scratch);
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
        crc = crc_of(&exact, &plain);
        assert_int_equal(crc_of(&large, &plain), crc);
        fixed = exact;
        memset(level_0, CANARY, sizeof level_0);
        memcpy(level_0, exact.work, exact.info.work_nbytes);
        fixed.dec = (saga_decoder *)(void *)level_0;
        assert_int_equal(crc_of(&fixed, &plain), crc);
        assert_ok(saga_open(&fixed.dec, level_0, sizeof level_0, exact.bytes,
                            exact.n, NULL));
        free(large.work);
        player_close(&exact);
    }
}

/* --- Samples ------------------------------------------------------------- */

static uint32_t apart(uint32_t a, uint32_t b)
{
    return a < b ? b - a : a - b;
}

/* Checks that a picture of 8 bits is one of 16 bits divided by 257 and rounded,
 * since 65535 = 255 * 257. */
static void check_depths(const player *s)
{
    const division d8 = { 16, 100, 2, 1u << 30, 8 };
    const division d16 = { 32, 37, 1, 999, 16 };
    const size_t n = 3u * s->camera.width * s->camera.height;
    FREED uint8_t *const p = draw(s, &d8);
    FREED uint16_t *const q = (uint16_t *)(void *)draw(s, &d16);

    for (size_t i = 0; i < n; i++)
        assert_true(apart((q[i] + 128u) / 257u, p[i]) <= 1);
}

TEST(samples_of_16_bits_should_be_those_of_8)
{
    for (uint32_t i = 0; i < N_STREAMS; i++) {
        const gen_options o = options_of(i);
        FREED_BY(player_close) player s;

        make_scene(&s, &o);
        check_depths(&s);
    }
}

/* --- The picture's place ------------------------------------------------- */

/* Draws a job whose `rgb` points at its pixel (x0, y0), with rows wider than
 * the job. Its pixels must be those of the whole picture, and no other byte may
 * change. */
static void check_rect(const player *s, const uint8_t *whole, int bits,
                       const int32_t rect[4], int32_t tile)
{
    const division d = { tile, 37, 2, 333, bits };
    const size_t sample = bits == 16 ? 2 : 1;
    const size_t width = 3 * sample * (size_t)(rect[2] - rect[0]);
    const size_t stride = width + 10 * sample;
    const size_t rows = (size_t)(rect[3] - rect[1]);
    const size_t n = stride * (rows - 1) + width;
    const size_t line = line_nbytes(s, &d);
    FREED uint8_t *const p = must(malloc(n));
    const saga_picture picture = { p, stride, n, bits };

    memset(p, CANARY, n);
    draw_rect(s, &d, rect[0], rect[1], rect[2], rect[3], &picture);
    for (size_t y = 0; y < rows; y++) {
        const uint8_t *const from = whole + ((size_t)rect[1] + y) * line +
                                    3 * sample * (size_t)rect[0];

        assert_memory_equal(p + y * stride, from, width);
        for (size_t x = width; y + 1 < rows && x < stride; x++)
            assert_int_equal(p[y * stride + x], CANARY);
    }
}

TEST(job_should_begin_at_the_first_sample)
{
    static const int32_t rects[][4] = {
        { 0, 0, 160, 120 },  { 5, 7, 6, 8 },    { 159, 119, 160, 120 },
        { 3, 0, 131, 1 },    { 0, 50, 1, 120 }, { 17, 33, 100, 99 },
        { 64, 64, 128, 120 }
    };
    static const int32_t tiles[] = { 8, 16, 32, 64 };
    const gen_options o = options_of(1);
    FREED_BY(player_close) player s;

    make_scene(&s, &o);
    assert_int_equal(s.camera.width, 160);
    assert_int_equal(s.camera.height, 120);
    for (uint32_t bits = 8; bits <= 16; bits += 8) {
        const division d = { 16, 500, 1, 1u << 30, (int)bits };
        FREED uint8_t *const whole = draw(&s, &d);

        for (uint32_t i = 0; i < sizeof rects / sizeof *rects; i++)
            for (uint32_t k = 0; k < 4; k++)
                check_rect(&s, whole, (int)bits, rects[i], tiles[k]);
    }
}

/* --- What draw refuses --------------------------------------------------- */

typedef struct {
    saga_job job;
    saga_picture picture;
} call;

static void good_call(call *c, const player *s, uint8_t *pixels, size_t n,
                      void *scratch)
{
    memset(c, 0, sizeof *c);
    c->job.x1 = s->camera.width;
    c->job.y1 = s->camera.height;
    c->job.tile = 16;
    c->job.list_capacity = 10;
    c->job.scratch = scratch;
    c->job.scratch_nbytes = SAGA_JOB_NBYTES(16, 10);
    c->picture.rgb = pixels;
    c->picture.stride_nbytes = 3u * s->camera.width;
    c->picture.nbytes = n;
    c->picture.bits = 8;
}

TEST(jobs_that_cannot_be_should_be_refused)
{
    const gen_options o = options_of(1);
    call good, c;
    player s;
    uint8_t *p, *scratch;
    size_t n;

    make_scene(&s, &o);
    n = 3u * s.camera.width * s.camera.height;
    p = must(malloc(2 * n));
    scratch = must(malloc(SAGA_JOB_NBYTES(16, 10) + 4));
    memset(p, CANARY, 2 * n);
    good_call(&good, &s, p, n, scratch);
#define REFUSED(status, change)                                          \
    do {                                                                 \
        c = good;                                                        \
        change;                                                          \
        assert_int_equal(saga_draw(s.dec, &c.job, &c.picture, 1u << 30), \
                         status);                                        \
    } while (0)
    REFUSED(SAGA_ERR_ARG, c.job.tile = 0);
    REFUSED(SAGA_ERR_ARG, c.job.tile = 24);
    REFUSED(SAGA_ERR_ARG, c.job.tile = -16);
    REFUSED(SAGA_ERR_ARG, c.job.tile = 128);
    REFUSED(SAGA_ERR_ARG, c.job.list_capacity = 0);
    REFUSED(SAGA_ERR_ARG, c.job.x0 = -1);
    REFUSED(SAGA_ERR_ARG, c.job.y0 = INT32_MIN);
    REFUSED(SAGA_ERR_ARG, c.job.x0 = c.job.x1);
    REFUSED(SAGA_ERR_ARG, c.job.x1 = s.camera.width + 1);
    REFUSED(SAGA_ERR_ARG, c.job.y1 = INT32_MAX);
    REFUSED(SAGA_ERR_ARG, c.picture.bits = 12);
    REFUSED(SAGA_ERR_ARG, c.picture.stride_nbytes--);
    REFUSED(SAGA_ERR_SPACE, c.picture.nbytes--);
    REFUSED(SAGA_ERR_SPACE, c.picture.stride_nbytes++);
    REFUSED(SAGA_ERR_SPACE, c.picture.stride_nbytes = SIZE_MAX);
    REFUSED(SAGA_ERR_SPACE, c.job.scratch_nbytes--);
    REFUSED(SAGA_ERR_SPACE, c.job.list_capacity = UINT32_MAX);
    REFUSED(SAGA_ERR_ALIGN, c.job.scratch = scratch + 1);
    REFUSED(SAGA_ERR_ALIGN,
            (c.picture.bits = 16, c.picture.rgb = p + 1,
             c.picture.stride_nbytes *= 2, c.picture.nbytes *= 2));
#undef REFUSED
    for (n *= 2; n > 0; n--)
        assert_int_equal(p[n - 1], CANARY);
    assert_ok(saga_draw(s.dec, &good.job, &good.picture, 1u << 30));
    free(scratch);
    free(p);
    player_close(&s);
}
