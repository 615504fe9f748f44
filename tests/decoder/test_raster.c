/* SPDX-License-Identifier: MIT
 *
 * Blending. A single splat on black, drawn with 16 bits, shows the weight of
 * every pixel: against double, which pixels it touches; against the formula of
 * the norm, how much. Scenes are compared with the norm pixel by pixel, and
 * with themselves over everything that must not show: tiles, lists, scratch,
 * budgets, division among threads.
 */
#include "depth_sort.h"
#include "gen_hard.h"
#include "model.h"
#include "project.h"
#include "raster.h"
#include "ref_render.h"
#include "testing.h"

#define CUT (SAGA_CUT_LOG2 << 20)
#define CANARY 0xa5
enum { GUARD = 64 };

static const double eps = 7e-4;
static saga_cpu cpu;            /* all tests run with each of this machine's */

/* --- Scenes -------------------------------------------------------------- */

typedef struct {
    saga_camera cam;
    saga_splat *splats;
    saga_key *order;
    uint32_t n;
} scene;

static void *need(size_t nbytes)
{
    return must(malloc(nbytes ? nbytes : 1));
}

static void sort_scene(scene *s)
{
    saga_key *const tmp = need(s->n * sizeof *tmp);
    uint32_t i;

    for (i = 0; i < s->n; i++)
        s->order[i] = (saga_key){ s->splats[i].depth, i };
    saga_depth_sort(s->order, tmp, s->n);
    (void)saga_raster_boxes(s->order, s->splats, s->n, &s->cam);
    free(tmp);
}

static void new_scene(scene *s, uint32_t n, int width, int height)
{
    gen_front_camera(&s->cam, width, height);
    s->splats = need(n * sizeof *s->splats);
    s->order = need(n * sizeof *s->order);
    s->n = n;
}

static void free_scene(scene *s)
{
    free(s->splats);
    free(s->order);
}

/* n visible splats of all kinds, many of them small. */
static void hard_scene(scene *s, gen_rng *r, uint32_t n, int width, int height)
{
    const uint32_t wanted = n;
    saga_animated a;

    new_scene(s, n, width, height);
    gen_hard_camera(&s->cam, r, width, height);
    for (n = 0; n < wanted;) {
        gen_hard_animated(&a, r, &s->cam);
        if (!saga_project(s->splats + n, &a, &s->cam, 0))
            continue;
        if (gen_int(r, 0, 3) == 0)
            s->splats[n].depth &= 0xffff0000; /* many are equal */
        gen_colour(s->splats[n].colour_q15, n);
        n++;
    }
    sort_scene(s);
}

/* A scene of pictures: small splats, everywhere. */
static void even_scene(scene *s, gen_rng *r, uint32_t n, int width, int height)
{
    saga_primitive *const p = need(n * sizeof *p);

    new_scene(s, n, width, height);
    gen_uniform_scene(p, n, r, &s->cam);
    s->n = gen_splats(s->splats, NULL, p, &gen_still_format, n, &s->cam, 0);
    sort_scene(s);
    free(p);
}

/* --- Pictures ------------------------------------------------------------ */

/* In bytes. */
static size_t pixel_of(int bits)
{
    return bits == SAGA_DEPTH ? sizeof(saga_depth) : 3 * (size_t)(bits / 8);
}

/* Rows of width pixels, a gap after each, guards around. */
typedef struct {
    uint8_t *block;
    size_t nbytes;          /* of the block */
    saga_picture pic;       /* of the whole picture */
    int width, height;
} picture;

static void new_picture(picture *p, int width, int height, int bits,
                        size_t gap)
{
    const size_t line = (size_t)width * pixel_of(bits);

    p->width = width;
    p->height = height;
    p->pic.bits = bits;
    p->pic.stride_nbytes = line + gap;
    p->pic.nbytes = p->pic.stride_nbytes * (size_t)(height - 1) + line;
    p->nbytes = p->pic.nbytes + 2 * GUARD;
    p->block = need(p->nbytes);
    p->pic.rgb = p->block + GUARD;
    memset(p->block, CANARY, p->nbytes);
}

static uint8_t *sample_at(const picture *p, int x, int y)
{
    return (uint8_t *)p->pic.rgb + (size_t)y * p->pic.stride_nbytes +
           (size_t)x * pixel_of(p->pic.bits);
}

static uint32_t value_at(const picture *p, int x, int y, int k)
{
    const uint8_t *const s = sample_at(p, x, y);
    uint16_t v;

    if (p->pic.bits == 8)
        return s[k];
    memcpy(&v, s + 2 * k, 2);
    return v;
}

/* The picture from the pixel (x, y) on, as a job there wants it. */
static saga_picture part_at(const picture *p, int x, int y)
{
    saga_picture part = p->pic;

    part.rgb = sample_at(p, x, y);
    part.nbytes -= (size_t)(sample_at(p, x, y) - sample_at(p, 0, 0));
    return part;
}

static void exact_picture(picture *p, const scene *s, int bits)
{
    new_picture(p, s->cam.width, s->cam.height, bits, 0);
    if (bits == SAGA_DEPTH)
        ref_depth_exact(&p->pic, &s->cam, s->splats, s->order, s->n);
    else
        ref_blend_exact(&p->pic, &s->cam, s->splats, s->order, s->n);
}

static void expect_equal(const picture *got, const picture *want)
{
    const size_t line = (size_t)want->width * pixel_of(want->pic.bits);
    int y;

    for (y = 0; y < want->height; y++)
        assert_memory_equal(sample_at(got, 0, y), sample_at(want, 0, y), line);
}

static const int all_bits[] = { 8, 16, SAGA_DEPTH };
enum { N_BITS = sizeof all_bits / sizeof *all_bits };

/* --- Jobs ---------------------------------------------------------------- */

typedef struct {
    int32_t tile;
    uint32_t capacity;
    size_t more;            /* scratch beyond the smallest */
    uint32_t budget;
} setting;

static const setting plain = { 16, 4000, 1 << 16, UINT32_MAX };

static void new_job(saga_job *job, const setting *with, int32_t x0, int32_t y0,
                    int32_t x1, int32_t y1)
{
    memset(job, 0, sizeof *job);
    job->x0 = x0;
    job->y0 = y0;
    job->x1 = x1;
    job->y1 = y1;
    job->tile = with->tile;
    job->list_capacity = with->capacity;
    job->scratch_nbytes = SAGA_JOB_NBYTES(with->tile, with->capacity) +
                          with->more;
    job->scratch = need(job->scratch_nbytes);
    memset(job->scratch, CANARY, job->scratch_nbytes);
}

static saga_drawing drawing_of(const scene *s)
{
    return (saga_drawing){ &s->cam, s->splats, s->order, s->n, cpu, 0 };
}

/* Calls until the job is finished; returns how many. */
static uint32_t finish_job(saga_job *job, const saga_picture *pic,
                           const scene *s, uint32_t budget)
{
    uint32_t calls = 1;

    const saga_drawing d = drawing_of(s);

    while (saga_raster(job, pic, &d, budget) == SAGA_AGAIN)
        calls++;
    assert_int_equal(saga_raster(job, pic, &d, budget), SAGA_OK);
    return calls;
}

static uint32_t draw_part(const picture *p, const scene *s, const setting *with,
                          int32_t x0, int32_t y0, int32_t x1, int32_t y1)
{
    const saga_picture part = part_at(p, x0, y0);
    saga_job job;
    uint32_t calls;

    new_job(&job, with, x0, y0, x1, y1);
    calls = finish_job(&job, &part, s, with->budget);
    free(job.scratch);
    return calls;
}

static uint32_t draw(const picture *p, const scene *s, const setting *with)
{
    return draw_part(p, s, with, 0, 0, p->width, p->height);
}

static void expect_with(const scene *s, const setting *with,
                        const picture *want)
{
    picture got;

    new_picture(&got, want->width, want->height, want->pic.bits, 0);
    draw(&got, s, with);
    expect_equal(&got, want);
    free(got.block);
}

/* --- One splat ----------------------------------------------------------- */

typedef struct {
    long visible, lost, invented, wrong, near;
} tally;

/* 0 if it is dropped. White on black: a sample of 16 bits is the weight, but
 * for the scale of 65535 / 65536. */
static int one_splat(scene *s, ref_splat *ref, gen_rng *r)
{
    const int width = gen_int(r, 1, 40), height = gen_int(r, 1, 40);
    saga_animated a;
    ref_animated ra;
    int k;

    gen_hard_camera(&s->cam, r, width, height);
    gen_hard_animated(&a, r, &s->cam);
    for (k = 0; k < 3; k++)
        s->cam.background_q15[k] = 0;
    if (!saga_project(s->splats, &a, &s->cam, 0))
        return 0;
    for (k = 0; k < 3; k++)
        s->splats->colour_q15[k] = 32768;
    ref_animated_of(&ra, &a);
    return ref_project(ref, &ra, &s->cam);
}

static void tally_pixel(tally *t, const scene *s, const ref_splat *ref, int x,
                        int y, uint32_t value)
{
    const saga_splat *const p = s->splats;
    const double q = ref_q(ref, x + 0.5 - p->mean_q8[0] / 256.0,
                           y + 0.5 - p->mean_q8[1] / 256.0);
    const int32_t q_q20 = ref_q_q20(p, x, y, 0);
    const uint32_t w = q_q20 < CUT ? ref_alpha_q16(q_q20) : 0;

    t->visible += value > 0;
    t->near += fabs(q - 11) <= eps;
    t->lost += value == 0 && q < 11 - eps;
    t->invented += value > 0 && q > 11 + eps;
    t->wrong += value != ((uint64_t)w * 65535 + 32768) >> 16;
}

TEST(splat_should_touch_the_pixels_below_the_cut)
{
    tally t = { 0, 0, 0, 0, 0 };
    gen_rng r = gen_seeded(31);
    scene s;
    int i, x, y;

    new_scene(&s, 1, 1, 1);
    for (i = 0; i < 15000; i++) {
        const setting with = { 8 << (i & 3), 1, 0, UINT32_MAX };
        ref_splat ref;
        picture p;

        if (!one_splat(&s, &ref, &r))
            continue;
        sort_scene(&s);
        new_picture(&p, s.cam.width, s.cam.height, 16, 0);
        draw(&p, &s, &with);
        for (y = 0; y < p.height; y++)
            for (x = 0; x < p.width; x++)
                tally_pixel(&t, &s, &ref, x, y, value_at(&p, x, y, 0));
        free(p.block);
    }
    print_message("%ld pixels visible: %ld lost, %ld invented, %ld not as the "
                  "norm has it; %ld within %g of the cut\n", t.visible, t.lost,
                  t.invented, t.wrong, t.near, eps);
    free_scene(&s);
    assert_true(t.visible > 300000);
    assert_int_equal(t.lost, 0);
    assert_int_equal(t.invented, 0);
    assert_int_equal(t.wrong, 0);
}

/* Splats without their projection: any factors, means far outside. The box
 * is the whole picture, so that spans alone decide. */
static void any_splat(saga_splat *p, gen_rng *r)
{
    const int32_t top = 720900000; /* 2.6856 in Q28 */
    int i;

    for (i = 0; i < 3; i++)
        p->chol_q28[i] = gen_shifted(r, 0, top, 29);
    if (gen_int(r, 0, 1))
        p->chol_q28[1] = -p->chol_q28[1];
    for (i = 0; i < 2; i++)
        p->mean_q8[i] = gen_shifted(r, -(1 << 23), 1 << 23, 16);
    p->q0_q20 = gen_shifted(r, 0, CUT - 1, 8);
    p->depth = 1 + gen_u32(r) % 1000;
    p->x0 = p->y0 = 0;
    p->x1 = p->y1 = 61;
    for (i = 0; i < 3; i++)
        p->colour_q15[i] = (uint16_t)gen_int(r, 0, 32768);
}

TEST(rows_should_equal_the_direct_formula)
{
    static const setting with[] = {
        { 8, 40, 0, UINT32_MAX }, { 64, 40, 0, UINT32_MAX }
    };
    gen_rng r = gen_seeded(32);
    picture want;
    scene s;
    int i;

    new_scene(&s, 1, 61, 61);
    for (i = 0; i < 3000; i++) {
        any_splat(s.splats, &r);
        sort_scene(&s);
        exact_picture(&want, &s, 16);
        expect_with(&s, &with[i & 1], &want);
        free(want.block);
    }
    free_scene(&s);
}

/* --- Scenes against the norm --------------------------------------------- */

TEST(scenes_should_be_those_of_the_norm)
{
    gen_rng r = gen_seeded(33);
    picture want;
    scene s;
    int i;

    for (i = 0; i < 40; i++) {
        const int width = gen_int(&r, 1, 90), height = gen_int(&r, 1, 70);

        if (i & 1)
            hard_scene(&s, &r, 250, width, height);
        else
            even_scene(&s, &r, 250, width, height);
        exact_picture(&want, &s, all_bits[i / 2 % N_BITS]);
        expect_with(&s, &plain, &want);
        free(want.block);
        free_scene(&s);
    }
}

TEST(nothing_should_show_the_background)
{
    static const uint16_t colours[][3] = {
        { 0, 1, 32768 }, { 16384, 32767, 64 }, { 32768, 32768, 32768 }
    };
    picture p;
    scene s;
    int i, k, bits;

    new_scene(&s, 0, 9, 11);
    for (bits = 8; bits <= 16; bits += 8)
        for (i = 0; i < 3; i++) {
            const int max = bits == 8 ? 255 : 65535;

            memcpy(s.cam.background_q15, colours[i], sizeof colours[i]);
            new_picture(&p, 9, 11, bits, 0);
            draw(&p, &s, &plain);
            for (k = 0; k < 9 * 11 * 3; k++)
                assert_int_equal(value_at(&p, k / 3 % 9, k / 27, k % 3),
                                 floor(colours[i][k % 3] / 32768.0 * max +
                                       0.5));
            free(p.block);
        }
    free_scene(&s);
}

/* The first splat at full opacity leaves 656 of 65536 for what is behind. */
TEST(opaque_splat_should_hide_what_is_behind)
{
    picture p;
    scene s;
    int i, k;

    new_scene(&s, 2, 33, 33);
    for (i = 0; i < 2; i++) {
        saga_splat *const q = s.splats + i;

        memset(q, 0, sizeof *q);
        q->mean_q8[0] = q->mean_q8[1] = 16 * 256 + 128;
        q->chol_q28[0] = q->chol_q28[2] = 1 << 20;
        q->depth = i ? 1 : 2;
        q->x1 = q->y1 = 33;
        q->colour_q15[i] = 32768;
    }
    sort_scene(&s);
    for (k = 0; k < 3; k++)
        s.cam.background_q15[k] = 0;
    new_picture(&p, 33, 33, 16, 0);
    draw(&p, &s, &plain);
    assert_int_equal(value_at(&p, 16, 16, 1), 64879); /* cap, 65535 / 65536 */
    assert_int_equal(value_at(&p, 16, 16, 0), 649);
    assert_int_equal(value_at(&p, 16, 16, 2), 0);
    free(p.block);
    free_scene(&s);
}

/* Equal depths: the lower index is in front, wherever its splat lies. */
TEST(equal_depths_should_be_drawn_by_index)
{
    gen_rng r = gen_seeded(34);
    picture want, other;
    uint32_t i;
    scene s;

    even_scene(&s, &r, 600, 64, 48);
    for (i = 0; i < s.n; i++)
        s.splats[i].depth = 1000 + i % 3;
    sort_scene(&s);
    for (i = 1; i < s.n; i++) {
        const uint32_t a = s.order[i - 1].index, b = s.order[i].index;

        assert_true(s.splats[a].depth < s.splats[b].depth ||
                    (s.splats[a].depth == s.splats[b].depth && a < b));
    }
    exact_picture(&want, &s, 8);
    expect_with(&s, &plain, &want);
    for (i = 0; i < s.n / 2; i++) { /* the opposite order does show */
        const saga_key k = s.order[i];

        s.order[i] = s.order[s.n - 1 - i];
        s.order[s.n - 1 - i] = k;
    }
    exact_picture(&other, &s, 8);
    assert_memory_not_equal(want.pic.rgb, other.pic.rgb, want.pic.nbytes);
    free(want.block);
    free(other.block);
    free_scene(&s);
}

/* --- The stop ------------------------------------------------------------ */

/* Two opaque splats that fill the left half of a tile, and 100 behind them
 * that fill all of it: on the left T is 7 after two. */
static void half_finished_scene(scene *s)
{
    uint32_t i;

    new_scene(s, 102, 16, 16);
    for (i = 0; i < s->n; i++) {
        saga_splat *const p = s->splats + i;

        memset(p, 0, sizeof *p);
        p->mean_q8[0] = i < 2 ? 0 : 8 * 256;
        p->mean_q8[1] = 8 * 256;
        p->chol_q28[0] = i < 2 ? 1 << 25 : 1 << 20;
        p->chol_q28[2] = 1 << 20;
        p->q0_q20 = i < 2 ? 0 : 5 << 20;
        p->depth = i + 1;
        p->x1 = p->y1 = 16;
        p->colour_q15[i % 3] = 32768;
    }
    sort_scene(s);
}

/* Blue at a pixel if its T did not stop anything. */
static uint32_t unstopped(const scene *s, int x, int y, int k)
{
    uint64_t sum = 0;
    uint32_t t = 65536;
    uint32_t i;

    for (i = 0; i < s->n; i++) {
        const saga_splat *const p = s->splats + s->order[i].index;
        const int32_t q = ref_q_q20(p, x, y, 0);
        const uint32_t a = q < CUT ? ref_alpha_q16(q) : 0;
        const uint32_t w = (a * t + 0x8000) >> 16;

        sum += (uint64_t)w * p->colour_q15[k];
        t -= w;
    }
    sum += (uint64_t)t * s->cam.background_q15[k];
    return (uint32_t)((sum * 65535 + (1 << 30)) >> 31);
}

TEST(stop_should_be_that_of_the_pixel)
{
    static const int32_t tiles[] = { 8, 16, 32, 64 };
    picture want;
    uint32_t diff = 0;
    scene s;
    int i;

    half_finished_scene(&s);
    s.splats[2].q0_q20 = 0; /* what a stop of the tile would let through */
    s.splats[2].colour_q15[1] = 32768;
    exact_picture(&want, &s, 16);
    for (i = 0; i < 4; i++) {
        const setting with = { tiles[i], 37, 0, UINT32_MAX };

        expect_with(&s, &with, &want);
    }
    for (i = 0; i < 256; i++) {
        const int x = i & 15, y = i >> 4;

        diff += value_at(&want, x, y, 2) != unstopped(&s, x, y, 2);
    }
    print_message("a stop of the tile would show at %u of 256 pixels\n", diff);
    assert_true(diff >= 4);
    free(want.block);
    free_scene(&s);
}

/* Long after everything is opaque: the early end of a tile may not show. */
TEST(finished_tiles_should_not_change)
{
    static const setting with[] = {
        { 8, 1, 0, UINT32_MAX }, { 8, 37, 0, 100 }, { 16, 4000, 0, 7 },
        { 64, 4000, 1 << 17, UINT32_MAX }
    };
    gen_rng r = gen_seeded(35);
    picture want;
    scene s;
    uint32_t i;

    even_scene(&s, &r, 1500, 50, 30);
    for (i = 0; i < s.n; i++) {
        s.splats[i].q0_q20 >>= 3;
        if (s.splats[i].mean_q8[0] < 40 * 256)
            s.splats[i].q0_q20 = 0;
        s.splats[i].x0 = s.splats[i].y0 = 0; /* the boxes were smaller */
        s.splats[i].x1 = 50;
        s.splats[i].y1 = 30;
    }
    sort_scene(&s);
    exact_picture(&want, &s, 16);
    for (i = 0; i < 4; i++)
        expect_with(&s, &with[i], &want);
    free(want.block);
    free_scene(&s);
}

/* --- What must not show -------------------------------------------------- */

TEST(picture_should_not_depend_on_the_job)
{
    static const uint32_t capacity[] = { 1, 37, 4000 };
    static const size_t more[] = { 0, 1, 5000, 70001, 1 << 20 };
    static const uint32_t budget[] = { 1, 2, 3, 7, 64, 1000, UINT32_MAX };
    gen_rng r = gen_seeded(36);
    picture want;
    scene s;
    int t, c, m, b;

    hard_scene(&s, &r, 90, 83, 61);
    exact_picture(&want, &s, 8);
    for (t = 8; t <= 64; t *= 2)
        for (c = 0; c < 3; c++)
            for (m = 0; m < 5; m++)
                for (b = 0; b < 7; b++) {
                    const setting with = { t, capacity[c], more[m],
                                           budget[b] };

                    expect_with(&s, &with, &want);
                }
    free(want.block);
    free_scene(&s);
}

/* Cuts of a side into n parts, as even as they go. */
static int32_t cut(int side, int i, int n)
{
    return (int32_t)(side * i / n);
}

static void draw_grid(const picture *p, const scene *s, const setting *with,
                      int cols, int rows)
{
    int i;

    for (i = cols * rows - 1; i >= 0; i--)
        draw_part(p, s, with, cut(p->width, i % cols, cols),
                  cut(p->height, i / cols, rows),
                  cut(p->width, i % cols + 1, cols),
                  cut(p->height, i / cols + 1, rows));
}

TEST(picture_should_not_depend_on_the_division)
{
    static const int grids[][2] = { { 1, 4 }, { 4, 1 }, { 1, 61 }, { 83, 1 },
                                    { 3, 5 }, { 83, 61 } };
    gen_rng r = gen_seeded(37);
    picture want, got;
    scene s;
    int i, b, tile;

    hard_scene(&s, &r, 90, 83, 61);
    for (b = 0; b < N_BITS; b++) {
        exact_picture(&want, &s, all_bits[b]);
        for (i = 0; i < 6; i++)
            for (tile = 8; tile <= (i < 5 ? 64 : 8); tile *= 2) {
                const setting with = { tile, 37, 3000, 500 };

                new_picture(&got, 83, 61, all_bits[b], 16);
                draw_grid(&got, &s, &with, grids[i][0], grids[i][1]);
                expect_equal(&got, &want);
                free(got.block);
            }
        free(want.block);
    }
    free_scene(&s);
}

/* --- Memory -------------------------------------------------------------- */

static int is_inside(const saga_job *job, int x, int y)
{
    return x >= job->x0 && x < job->x1 && y >= job->y0 && y < job->y1;
}

/* Every byte of the block is a canary or a pixel of the job. */
static void check_canaries(const picture *p, const saga_job *job)
{
    const size_t pixel = pixel_of(p->pic.bits);
    uint8_t *const is_ours = need(p->nbytes);
    size_t i;
    int x, y;

    memset(is_ours, 0, p->nbytes);
    for (y = job->y0; y < job->y1; y++)
        for (x = job->x0; x < job->x1; x++)
            if (is_inside(job, x, y))
                memset(is_ours + (sample_at(p, x, y) - p->block), 1, pixel);
    for (i = 0; i < p->nbytes; i++)
        assert_true(is_ours[i] || p->block[i] == CANARY);
    free(is_ours);
}

static void expect_part(const picture *got, const picture *want,
                        const saga_job *job)
{
    int y;

    for (y = job->y0; y < job->y1; y++)
        assert_memory_equal(sample_at(got, job->x0, y),
                            sample_at(want, job->x0, y),
                            (size_t)(job->x1 - job->x0) *
                                pixel_of(got->pic.bits));
}

/* The scratch has its exact size, for the sanitizers, and is guarded. */
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
    scene s;
    int i;

    hard_scene(&s, &r, 60, 83, 61);
    for (i = 0; i < 400; i++) {
        exact_picture(&want, &s, all_bits[i % N_BITS]);
        check_memory(&s, &want, &r);
        free(want.block);
    }
    free_scene(&s);
}

/* --- The budget ---------------------------------------------------------- */

/* After every call a pixel is untouched or final. */
TEST(pixels_should_be_written_when_final)
{
    const setting with = { 8, 37, 3000, 97 };
    gen_rng r = gen_seeded(39);
    picture want, got;
    saga_drawing d;
    saga_job job;
    scene s;
    int x, y, partial = 0;

    hard_scene(&s, &r, 60, 47, 33);
    exact_picture(&want, &s, 8);
    new_picture(&got, 47, 33, 8, 0);
    new_job(&job, &with, 0, 0, 47, 33);
    d = drawing_of(&s);
    while (saga_raster(&job, &got.pic, &d, with.budget) == SAGA_AGAIN)
        for (y = 0; y < 33; y++)
            for (x = 0; x < 47; x++)
                if (memcmp(sample_at(&got, x, y), sample_at(&want, x, y), 3)) {
                    assert_int_equal(*sample_at(&got, x, y), CANARY);
                    partial++;
                }
    assert_true(partial > 0);
    expect_equal(&got, &want);
    free(job.scratch);
    free(got.block);
    free(want.block);
    free_scene(&s);
}

/* A budget of b does in a call what 1 does in at most b. */
TEST(budget_should_bound_the_calls)
{
    static const uint32_t budget[] = { 2, 3, 10, 1000, 100000 };
    gen_rng r = gen_seeded(40);
    uint32_t units, calls;
    picture p;
    scene s;
    int i;

    hard_scene(&s, &r, 60, 47, 33);
    new_picture(&p, 47, 33, 8, 0);
    units = draw(&p, &s, &(setting){ 16, 37, 0, 1 });
    for (i = 0; i < 5; i++) {
        calls = draw(&p, &s, &(setting){ 16, 37, 0, budget[i] });
        assert_in_range(calls, units / budget[i], units / budget[i] + 2);
    }
    print_message("%u units of work\n", units);
    assert_int_equal(draw(&p, &s, &(setting){ 16, 37, 0, UINT32_MAX }), 1);
    free(p.block);
    free_scene(&s);
}

TEST(finished_job_should_write_nothing)
{
    gen_rng r = gen_seeded(41);
    picture p;
    saga_drawing d;
    saga_job job;
    scene s;

    even_scene(&s, &r, 50, 20, 20);
    new_picture(&p, 20, 20, 8, 0);
    new_job(&job, &plain, 0, 0, 20, 20);
    finish_job(&job, &p.pic, &s, UINT32_MAX);
    memset(p.block, CANARY, p.nbytes);
    d = drawing_of(&s);
    assert_int_equal(saga_raster(&job, &p.pic, &d, 1), SAGA_OK);
    assert_int_equal(value_at(&p, 0, 0, 0), CANARY);
    assert_int_equal(value_at(&p, 19, 19, 2), CANARY);
    free(job.scratch);
    free(p.block);
    free_scene(&s);
}

/* --- Checks -------------------------------------------------------------- */

typedef struct {
    scene s;
    picture p;
    saga_job job;
    void *scratch;
} checked;

/* A job of the pixels (3, 2) to (20, 30) of 20 x 30. */
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
    checked c;

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
    close_checked(&c);
}

TEST(other_fields_should_be_checked)
{
    static const int32_t tiles[] = { 0, -8, 1, 4, 7, 9, 24, 128, 1 << 30,
                                     INT32_MIN };
    checked c;
    size_t i;

    open_checked(&c, 8);
    for (i = 0; i < sizeof tiles / sizeof *tiles; i++)
        expect_arg(&c, &c.job.tile, tiles[i]);
    for (i = 0; i < 40; i++)
        if (i != 8 && i != 16)
            expect_arg(&c, &c.p.pic.bits, (int32_t)i);
    expect_arg(&c, &c.p.pic.bits, SAGA_DEPTH - 1);
    expect_arg(&c, &c.p.pic.bits, -8);
    c.job.list_capacity = 0;
    expect_status(&c, SAGA_ERR_ARG);
    close_checked(&c);
}

TEST(scratch_should_be_large_enough)
{
    static const size_t small[] = { 0, 1, 255, 256, 263, 264, 304 };
    checked c;
    size_t i, least;

    open_checked(&c, 8);
    least = c.job.scratch_nbytes;
    assert_int_equal(least, 8 * 8 * 16 + 5 * 8 + 264);
    for (i = 0; i < sizeof small / sizeof *small; i++) {
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
    close_checked(&c);
}

TEST(scratch_should_be_aligned)
{
    checked c;
    int i;

    open_checked(&c, 8);
    free(c.scratch);
    c.scratch = need(c.job.scratch_nbytes + 4);
    for (i = 0; i <= 4; i++) {
        c.job.scratch = (uint8_t *)c.scratch + i;
        expect_status(&c, i & 3 ? SAGA_ERR_ALIGN : SAGA_OK);
    }
    close_checked(&c);
}

/* Rows of 17 pixels, 28 of them. */
TEST(picture_should_be_large_enough)
{
    checked c;
    size_t line;
    int b;

    for (b = 0; b < N_BITS; b++) {
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
    checked c;

    open_checked(&c, 8);
    c.job.y1 = 3;
    c.p.pic.stride_nbytes = 0;
    c.p.pic.nbytes = 17 * 3;
    expect_status(&c, SAGA_OK);
    c.p.pic.nbytes--;
    expect_status(&c, SAGA_ERR_SPACE);
    close_checked(&c);
}

TEST(samples_of_16_bits_should_be_aligned)
{
    checked c;

    open_checked(&c, 16);
    expect_status(&c, SAGA_OK);
    c.p.pic.rgb = (uint8_t *)c.p.pic.rgb - 1;
    expect_status(&c, SAGA_ERR_ALIGN);
    c.p.pic.rgb = (uint8_t *)c.p.pic.rgb + 1;
    c.p.pic.stride_nbytes--;
    expect_status(&c, SAGA_ERR_ALIGN);
    close_checked(&c);
}

TEST(depths_should_be_aligned)
{
    checked c;
    int i;

    open_checked(&c, SAGA_DEPTH);
    for (i = 0; i <= 8; i++) {
        expect_status(&c, i & 7 ? SAGA_ERR_ALIGN : SAGA_OK);
        c.p.pic.rgb = (uint8_t *)c.p.pic.rgb - 1;
    }
    c.p.pic.rgb = (uint8_t *)c.p.pic.rgb + 1;
    c.p.pic.stride_nbytes -= 4;
    expect_status(&c, SAGA_ERR_ALIGN);
    close_checked(&c);
}

TEST(samples_of_8_bits_may_lie_anywhere)
{
    gen_rng r = gen_seeded(42);
    picture want, got;
    scene s;

    even_scene(&s, &r, 100, 31, 17);
    exact_picture(&want, &s, 8);
    new_picture(&got, 31, 17, 8, 2);
    got.pic.rgb = (uint8_t *)got.pic.rgb + 1;
    draw(&got, &s, &plain);
    expect_equal(&got, &want);
    free(want.block);
    free(got.block);
    free_scene(&s);
}

/* --- Against double ------------------------------------------------------ */

static void colour_truly(ref_splat *s, uint32_t index)
{
    uint16_t colour[3];
    int k;

    gen_colour(colour, index);
    for (k = 0; k < 3; k++)
        s->colour[k] = colour[k] / 32768.0;
}

/* What is blended then: z and 1. */
static void colour_by_depth(ref_splat *s, uint32_t index)
{
    (void)index;
    s->colour[0] = s->depth;
    s->colour[1] = 1;
    s->colour[2] = 0;
}

typedef void colour_fn(ref_splat *s, uint32_t index);

/* The same primitives through the reference, start to end. */
static void true_picture(double *rgb, const saga_primitive *p, uint32_t n,
                         const saga_camera *cam, colour_fn *colour)
{
    ref_splat *const splats = need(n * sizeof *splats);
    uint32_t *const order = need(n * sizeof *order);
    uint32_t i, kept = 0;
    ref_primitive still;
    ref_animated a;

    for (i = 0; i < n; i++) {
        ref_primitive_of(&still, p + i, &gen_still_format);
        ref_animate(&a, &still, 0.5);
        if (ref_project(splats + kept, &a, cam))
            colour(splats + kept++, i);
    }
    ref_sort(order, splats, kept);
    ref_blend(rgb, cam, splats, order, kept);
    free(splats);
    free(order);
}

static void expect_close(const scene *s, const double *rgb, int bits)
{
    double psnr, steps;
    picture p;

    new_picture(&p, s->cam.width, s->cam.height, bits, 0);
    draw(&p, s, &plain);
    psnr = ref_psnr(&p.pic, &s->cam, rgb, &steps);
    steps *= bits == 16 ? 255.0 / 65535 : 1;
    print_message("%d bits: %.2f dB, at most %.2f of 255\n", bits, psnr,
                  steps);
    assert_true(psnr >= 57);
    assert_true(steps <= 2);
    free(p.block);
}

TEST(picture_should_be_that_of_double)
{
    enum { N = 20000, WIDTH = 320, HEIGHT = 180 };
    saga_primitive *const p = need(N * sizeof *p);
    double *const rgb = need(WIDTH * HEIGHT * 3 * sizeof *rgb);
    gen_rng r = gen_seeded(43);
    scene s;

    new_scene(&s, N, WIDTH, HEIGHT);
    gen_uniform_scene(p, N, &r, &s.cam);
    s.n = gen_splats(s.splats, NULL, p, &gen_still_format, N, &s.cam, 32768);
    sort_scene(&s);
    true_picture(rgb, p, N, &s.cam, colour_truly);
    expect_close(&s, rgb, 8);
    expect_close(&s, rgb, 16);
    free(rgb);
    free(p);
    free_scene(&s);
}

/* Expected depths differ where alpha does, which adds up to a picture's error
 * of 8 bits; means as far apart as the scene is deep weigh it. */
static void expect_depths(const scene *s, const double *truth)
{
    double most_alpha = 0, most = 0, sum = 0;
    long n = 0;
    picture p;
    int i;

    new_picture(&p, s->cam.width, s->cam.height, SAGA_DEPTH, 0);
    draw(&p, s, &plain);
    for (i = 0; i < p.width * p.height; i++) {
        const saga_depth *const d = (const saga_depth *)p.pic.rgb + i;
        const double alpha = truth[3 * i + 1];
        double off;

        most_alpha = fmax(most_alpha, fabs(d->weight_q16 / 65536.0 - alpha));
        if (alpha < 0.5)
            continue;
        off = fabs((double)d->sum_q16 / d->weight_q16 / truth[3 * i] * alpha -
                   1);
        most = fmax(most, off);
        sum += off * off;
        n++;
    }
    print_message("alpha at most %.5f off, depth %.5f of itself, %.6f rms\n",
                  most_alpha, most, sqrt(sum / (double)n));
    assert_true(n > p.width * p.height / 2);
    assert_true(most_alpha <= 2.0 / 255);
    assert_true(most <= 2.0 / 255);
    assert_true(sqrt(sum / (double)n) <= 4e-4);
    free(p.block);
}

TEST(depths_should_be_those_of_double)
{
    enum { N = 20000, WIDTH = 320, HEIGHT = 180 };
    saga_primitive *const p = need(N * sizeof *p);
    double *const truth = need(WIDTH * HEIGHT * 3 * sizeof *truth);
    gen_rng r = gen_seeded(44);
    scene s;

    new_scene(&s, N, WIDTH, HEIGHT);
    gen_uniform_scene(p, N, &r, &s.cam);
    memset(s.cam.background_q15, 0, sizeof s.cam.background_q15);
    s.n = gen_splats(s.splats, NULL, p, &gen_still_format, N, &s.cam, 32768);
    sort_scene(&s);
    true_picture(truth, p, N, &s.cam, colour_by_depth);
    expect_depths(&s, truth);
    free(truth);
    free(p);
    free_scene(&s);
}

int main(void)
{
    int failed = 0;

    for (cpu = SAGA_CPU_PLAIN; cpu <= saga_cpu_best(); cpu++)
        failed += testing_run();
    return failed;
}
