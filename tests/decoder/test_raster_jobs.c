/* SPDX-License-Identifier: MIT
 *
 * The picture of a scene must not depend on tiles, lists, scratch, budgets or
 * the division among threads. A job must write nothing except its own pixels,
 * and an invalid job is refused.
 */
#include "raster_scene.h"

/* --- What must not show -------------------------------------------------- */

TEST(picture_should_not_depend_on_the_job)
{
    static const uint32_t capacity[] = { 1, 37, 4000 };
    static const size_t more[] = { 0, 1, 5000, 70001, 1 << 20 };
    static const uint32_t budget[] = { 1, 2, 3, 7, 64, 1000, UINT32_MAX };
    gen_rng r = gen_seeded(36);
    picture want;
    FREED_BY(free_scene) scene s;

    hard_scene(&s, &r, 90, 83, 61);
    exact_picture(&want, &s, 8);
    for (int t = 8; t <= 64; t *= 2)
        for (int c = 0; c < 3; c++)
            for (int m = 0; m < 5; m++)
                for (int b = 0; b < 7; b++) {
                    const setting with = { t, capacity[c], more[m], budget[b] };

                    expect_with(&s, &with, &want);
                }
    free(want.block);
}

/* Returns cut i of a side into n parts that are as equal as possible. */
static int32_t cut(int side, int i, int n)
{
    return (int32_t)(side * i / n);
}

static void draw_grid(const picture *p, const scene *s, const setting *with,
                      int cols, int rows)
{
    for (int i = cols * rows - 1; i >= 0; i--)
        draw_part(p, s, with, cut(p->width, i % cols, cols),
                  cut(p->height, i / cols, rows),
                  cut(p->width, i % cols + 1, cols),
                  cut(p->height, i / cols + 1, rows));
}

TEST(picture_should_not_depend_on_the_division)
{
    static const int grids[][2] = { { 1, 4 },  { 4, 1 }, { 1, 61 },
                                    { 83, 1 }, { 3, 5 }, { 83, 61 } };
    gen_rng r = gen_seeded(37);
    picture want, got;
    FREED_BY(free_scene) scene s;

    hard_scene(&s, &r, 90, 83, 61);
    for (int b = 0; b < N_BITS; b++) {
        exact_picture(&want, &s, all_bits[b]);
        for (int i = 0; i < 6; i++)
            for (int tile = 8; tile <= (i < 5 ? 64 : 8); tile *= 2) {
                const setting with = { tile, 37, 3000, 500 };

                new_picture(&got, 83, 61, all_bits[b], 16);
                draw_grid(&got, &s, &with, grids[i][0], grids[i][1]);
                expect_equal(&got, &want);
                free(got.block);
            }
        free(want.block);
    }
}

/* --- Memory -------------------------------------------------------------- */

static int is_inside(const saga_job *job, int x, int y)
{
    return x >= job->x0 && x < job->x1 && y >= job->y0 && y < job->y1;
}

/* Checks that every byte of the block is a canary or a pixel of the job. */
static void check_canaries(const picture *p, const saga_job *job)
{
    const size_t pixel = pixel_of(p->pic.bits);
    FREED uint8_t *const is_ours = need(p->nbytes);

    memset(is_ours, 0, p->nbytes);
    for (int y = job->y0; y < job->y1; y++)
        for (int x = job->x0; x < job->x1; x++)
            if (is_inside(job, x, y))
                memset(is_ours + (sample_at(p, x, y) - p->block), 1, pixel);
    for (size_t i = 0; i < p->nbytes; i++)
        assert_true(is_ours[i] || p->block[i] == CANARY);
}

static void expect_part(const picture *got, const picture *want,
                        const saga_job *job)
{
    for (int y = job->y0; y < job->y1; y++)
        assert_memory_equal(
            sample_at(got, job->x0, y), sample_at(want, job->x0, y),
            (size_t)(job->x1 - job->x0) * pixel_of(got->pic.bits));
}

/* Draws with scratch of exactly the size that is passed, so that the sanitizers
 * notice every access outside, and with guards after it. */
static void check_memory(const scene *s, const picture *want, gen_rng *r)
{
    const int32_t tile = 8 << gen_int(r, 0, 3);
    const uint32_t capacity = (uint32_t)gen_int(r, 1, 60);
    const size_t more = (size_t)gen_int(r, 0, 20000);
    const setting with = { tile, capacity, more, UINT32_MAX };
    const int x0 = gen_int(r, 0, want->width - 1);
    const int y0 = gen_int(r, 0, want->height - 1);
    const int x1 = gen_int(r, x0 + 1, want->width);
    const int y1 = gen_int(r, y0 + 1, want->height);
    saga_picture part;
    saga_job job;
    uint8_t *block;
    picture got;

    new_picture(&got, want->width, want->height, want->pic.bits,
                8 * (size_t)gen_int(r, 0, 9));
    new_job(&job, &with, x0, y0, x1, y1);
    free(job.scratch);
    block = need(job.scratch_nbytes + 2 * GUARD);
    memset(block, CANARY, job.scratch_nbytes + 2 * GUARD);
    job.scratch = block + GUARD;
    part = part_at(&got, x0, y0);
    part.nbytes = part.stride_nbytes * (size_t)(y1 - y0 - 1) +
                  (size_t)(x1 - x0) * pixel_of(part.bits);
    finish_job(&job, &part, s, with.budget);
    expect_part(&got, want, &job);
    check_canaries(&got, &job);
    assert_memory_equal(block, got.block, GUARD);
    assert_memory_equal(block + GUARD + job.scratch_nbytes, got.block, GUARD);
    free(block);
    free(got.block);
}

TEST(nothing_else_should_be_written)
{
    gen_rng r = gen_seeded(38);
    picture want;
    FREED_BY(free_scene) scene s;

    hard_scene(&s, &r, 60, 83, 61);
    for (int i = 0; i < 400; i++) {
        exact_picture(&want, &s, all_bits[i % N_BITS]);
        check_memory(&s, &want, &r);
        free(want.block);
    }
}

/* --- The budget ---------------------------------------------------------- */

/* After every call of saga_raster a pixel must be either untouched or final. */
TEST(pixels_should_be_written_when_final)
{
    const setting with = { 8, 37, 3000, 97 };
    gen_rng r = gen_seeded(39);
    picture want, got;
    saga_drawing d;
    saga_job job;
    FREED_BY(free_scene) scene s;
    int partial = 0;

    hard_scene(&s, &r, 60, 47, 33);
    exact_picture(&want, &s, 8);
    new_picture(&got, 47, 33, 8, 0);
    new_job(&job, &with, 0, 0, 47, 33);
    d = drawing_of(&s);
    while (saga_raster(&job, &got.pic, &d, with.budget) == SAGA_AGAIN)
        for (int y = 0; y < 33; y++)
            for (int x = 0; x < 47; x++)
                if (memcmp(sample_at(&got, x, y), sample_at(&want, x, y), 3)) {
                    assert_int_equal(*sample_at(&got, x, y), CANARY);
                    partial++;
                }
    assert_true(partial > 0);
    expect_equal(&got, &want);
    free(job.scratch);
    free(got.block);
    free(want.block);
}

/* With a budget of b the job must take 1/b of the calls that it takes with a
 * budget of 1, and at most 2 more. */
TEST(budget_should_bound_the_calls)
{
    static const uint32_t budget[] = { 2, 3, 10, 1000, 100000 };
    gen_rng r = gen_seeded(40);
    uint32_t units, calls;
    picture p;
    FREED_BY(free_scene) scene s;

    hard_scene(&s, &r, 60, 47, 33);
    new_picture(&p, 47, 33, 8, 0);
    units = draw(&p, &s, &(setting){ 16, 37, 0, 1 });
    for (int i = 0; i < 5; i++) {
        calls = draw(&p, &s, &(setting){ 16, 37, 0, budget[i] });
        assert_in_range(calls, units / budget[i], units / budget[i] + 2);
    }
    print_message("%u units of work\n", units);
    assert_int_equal(draw(&p, &s, &(setting){ 16, 37, 0, UINT32_MAX }), 1);
    free(p.block);
}

TEST(finished_job_should_write_nothing)
{
    gen_rng r = gen_seeded(41);
    picture p;
    saga_drawing d;
    saga_job job;
    FREED_BY(free_scene) scene s;

    even_scene(&s, &r, 50, 20, 20);
    new_picture(&p, 20, 20, 8, 0);
    new_job(&job, &plain, 0, 0, 20, 20);
    finish_job(&job, &p.pic, &s, UINT32_MAX);
    memset(p.block, CANARY, p.nbytes);
    d = drawing_of(&s);
    assert_ok(saga_raster(&job, &p.pic, &d, 1));
    assert_int_equal(value_at(&p, 0, 0, 0), CANARY);
    assert_int_equal(value_at(&p, 19, 19, 2), CANARY);
    free(job.scratch);
    free(p.block);
}

/* --- Checks -------------------------------------------------------------- */

typedef struct {
    scene s;
    picture p;
    saga_job job;
    void *scratch;
} checked;

/* Opens a job that draws the pixels from (3, 2) to (20, 30) of a picture of
 * 20 x 30. */
static void open_checked(checked *c, int bits)
{
    new_scene(&c->s, 0, 20, 30);
    new_picture(&c->p, 20, 30, bits, 0);
    new_job(&c->job, &(setting){ 8, 5, 0, 1 }, 3, 2, 20, 30);
    c->scratch = c->job.scratch;
    c->p.pic = part_at(&c->p, 3, 2);
}

static void close_checked(checked *c)
{
    free(c->scratch);
    free(c->p.block);
    free_scene(&c->s);
}

static void expect_status(checked *c, saga_status status)
{
    const saga_drawing d = { &c->s.cam, NULL, NULL, 0, cpu, 0 };
    const saga_status got = saga_raster(&c->job, &c->p.pic, &d, 1);

    assert_int_equal(got == SAGA_AGAIN ? SAGA_OK : got, status);
    if (status != SAGA_OK)
        assert_int_equal(c->job.cursor[0], 0);
    memset(c->job.cursor, 0, sizeof c->job.cursor);
}

static void expect_arg(checked *c, int32_t *field, int32_t bad)
{
    const int32_t good = *field;

    expect_status(c, SAGA_OK);
    *field = bad;
    expect_status(c, SAGA_ERR_ARG);
    *field = good;
    expect_status(c, SAGA_OK);
}

TEST(rectangle_should_lie_in_the_picture)
{
    FREED_BY(close_checked) checked c;

    open_checked(&c, 8);
    expect_arg(&c, &c.job.x0, -1);
    expect_arg(&c, &c.job.x0, 20);
    expect_arg(&c, &c.job.x0, INT32_MIN);
    expect_arg(&c, &c.job.x0, INT32_MAX);
    expect_arg(&c, &c.job.y0, -1);
    expect_arg(&c, &c.job.y0, 30);
    expect_arg(&c, &c.job.x1, 3);
    expect_arg(&c, &c.job.x1, 21);
    expect_arg(&c, &c.job.x1, INT32_MAX);
    expect_arg(&c, &c.job.y1, 2);
    expect_arg(&c, &c.job.y1, 31);
    expect_arg(&c, &c.job.y1, INT32_MIN);
}

TEST(other_fields_should_be_checked)
{
    static const int32_t tiles[] = { 0, -8, 1,   4,       7,
                                     9, 24, 128, 1 << 30, INT32_MIN };
    FREED_BY(close_checked) checked c;

    open_checked(&c, 8);
    for (size_t i = 0; i < sizeof tiles / sizeof *tiles; i++)
        expect_arg(&c, &c.job.tile, tiles[i]);
    for (size_t i = 0; i < 40; i++)
        if (i != 8 && i != 16)
            expect_arg(&c, &c.p.pic.bits, (int32_t)i);
    expect_arg(&c, &c.p.pic.bits, SAGA_DEPTH - 1);
    expect_arg(&c, &c.p.pic.bits, -8);
    c.job.list_capacity = 0;
    expect_status(&c, SAGA_ERR_ARG);
}

TEST(scratch_should_be_large_enough)
{
    static const size_t small[] = { 0, 1, 255, 256, 263, 264, 304 };
    FREED_BY(close_checked) checked c;
    size_t least;

    open_checked(&c, 8);
    least = c.job.scratch_nbytes;
    assert_int_equal(least, 8 * 8 * 16 + 5 * 8 + 264);
    for (size_t i = 0; i < sizeof small / sizeof *small; i++) {
        c.job.scratch_nbytes = small[i];
        expect_status(&c, SAGA_ERR_SPACE);
    }
    c.job.scratch_nbytes = least - 1;
    expect_status(&c, SAGA_ERR_SPACE);
    c.job.scratch_nbytes = least;
    expect_status(&c, SAGA_OK);
    c.job.list_capacity = 6;
    expect_status(&c, SAGA_ERR_SPACE);
    c.job.list_capacity = UINT32_MAX;
    expect_status(&c, SAGA_ERR_SPACE);
    c.job.list_capacity = 1u << 29;
    expect_status(&c, SAGA_ERR_SPACE);
    c.job.list_capacity = 5;
    c.job.tile = 16;
    expect_status(&c, SAGA_ERR_SPACE);
}

TEST(scratch_should_be_aligned)
{
    FREED_BY(close_checked) checked c;

    open_checked(&c, 8);
    free(c.scratch);
    c.scratch = need(c.job.scratch_nbytes + 4);
    for (int i = 0; i <= 4; i++) {
        c.job.scratch = (uint8_t *)c.scratch + i;
        expect_status(&c, i & 3 ? SAGA_ERR_ALIGN : SAGA_OK);
    }
}

/* The job has 28 rows of 17 pixels. A picture whose memory is a byte too small
 * for them, or whose stride is too short or too long, must be refused. */
TEST(picture_should_be_large_enough)
{
    checked c;
    size_t line;

    for (int b = 0; b < N_BITS; b++) {
        open_checked(&c, all_bits[b]);
        line = 17 * pixel_of(all_bits[b]);
        c.p.pic.nbytes = c.p.pic.stride_nbytes * 27 + line;
        expect_status(&c, SAGA_OK);
        c.p.pic.nbytes--;
        expect_status(&c, SAGA_ERR_SPACE);
        c.p.pic.nbytes = 0;
        expect_status(&c, SAGA_ERR_SPACE);
        c.p.pic.nbytes = SIZE_MAX;
        c.p.pic.stride_nbytes = SIZE_MAX - 7;
        expect_status(&c, SAGA_ERR_SPACE);
        c.p.pic.stride_nbytes = line - 2;
        expect_status(&c, SAGA_ERR_ARG);
        c.p.pic.stride_nbytes = 0;
        expect_status(&c, SAGA_ERR_ARG);
        close_checked(&c);
    }
}

TEST(stride_of_a_single_row_should_not_matter)
{
    FREED_BY(close_checked) checked c;

    open_checked(&c, 8);
    c.job.y1 = 3;
    c.p.pic.stride_nbytes = 0;
    c.p.pic.nbytes = 17 * 3;
    expect_status(&c, SAGA_OK);
    c.p.pic.nbytes--;
    expect_status(&c, SAGA_ERR_SPACE);
}

TEST(samples_of_16_bits_should_be_aligned)
{
    FREED_BY(close_checked) checked c;

    open_checked(&c, 16);
    expect_status(&c, SAGA_OK);
    c.p.pic.rgb = (uint8_t *)c.p.pic.rgb - 1;
    expect_status(&c, SAGA_ERR_ALIGN);
    c.p.pic.rgb = (uint8_t *)c.p.pic.rgb + 1;
    c.p.pic.stride_nbytes--;
    expect_status(&c, SAGA_ERR_ALIGN);
}

TEST(depths_should_be_aligned)
{
    FREED_BY(close_checked) checked c;

    open_checked(&c, SAGA_DEPTH);
    for (int i = 0; i <= 8; i++) {
        expect_status(&c, i & 7 ? SAGA_ERR_ALIGN : SAGA_OK);
        c.p.pic.rgb = (uint8_t *)c.p.pic.rgb - 1;
    }
    c.p.pic.rgb = (uint8_t *)c.p.pic.rgb + 1;
    c.p.pic.stride_nbytes -= 4;
    expect_status(&c, SAGA_ERR_ALIGN);
}

TEST(samples_of_8_bits_may_lie_anywhere)
{
    gen_rng r = gen_seeded(42);
    picture want, got;
    FREED_BY(free_scene) scene s;

    even_scene(&s, &r, 100, 31, 17);
    exact_picture(&want, &s, 8);
    new_picture(&got, 31, 17, 8, 2);
    got.pic.rgb = (uint8_t *)got.pic.rgb + 1;
    draw(&got, &s, &plain);
    expect_equal(&got, &want);
    free(want.block);
    free(got.block);
}
