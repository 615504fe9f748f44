/* SPDX-License-Identifier: MIT
 *
 * Scenes of splats, pictures with guard bytes around them, and jobs that draw a
 * scene into a picture; also pictures by the integer reference, pixel by pixel.
 */
#ifndef RASTER_SCENE_H
#define RASTER_SCENE_H

#include "depth_sort.h"
#include "every_cpu.h"
#include "gen_hard.h"
#include "project.h"
#include "raster.h"
#include "ref_render.h"

#define CANARY 0xa5
enum { GUARD = 64 };

/* --- Scenes -------------------------------------------------------------- */

typedef struct {
    saga_camera cam;
    saga_splat *splats;
    saga_key *order;
    uint32_t n;
} scene;

static inline void *need(size_t nbytes)
{
    return must(malloc(nbytes ? nbytes : 1));
}

static inline void sort_scene(scene *s)
{
    saga_key *const tmp = need(s->n * sizeof *tmp);

    for (uint32_t i = 0; i < s->n; i++)
        s->order[i] = (saga_key){ s->splats[i].depth, i };
    saga_depth_sort(s->order, tmp, s->n);
    (void)saga_raster_boxes(s->order, s->splats, s->n, &s->cam);
    free(tmp);
}

static inline void new_scene(scene *s, uint32_t n, int width, int height)
{
    gen_front_camera(&s->cam, width, height);
    s->splats = need(n * sizeof *s->splats);
    s->order = need(n * sizeof *s->order);
    s->n = n;
}

static inline void free_scene(scene *s)
{
    free(s->splats);
    free(s->order);
}

/* Makes n visible splats of all kinds, many of which are small. */
static inline void hard_scene(scene *s, gen_rng *r, uint32_t n, int width,
                              int height)
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
            s->splats[n].depth &= 0xffff0000; /* many depths are equal */
        gen_colour(s->splats[n].colour_q15, n);
        n++;
    }
    sort_scene(s);
}

/* Makes a scene with small splats spread over the whole picture, as most
 * pictures have. */
static inline void even_scene(scene *s, gen_rng *r, uint32_t n, int width,
                              int height)
{
    saga_primitive *const p = need(n * sizeof *p);

    new_scene(s, n, width, height);
    gen_uniform_scene(p, n, r, &s->cam);
    s->n = gen_splats(s->splats, NULL, p, &gen_still_format, n, &s->cam, 0);
    sort_scene(s);
    free(p);
}

/* --- Pictures ------------------------------------------------------------ */

/* Returns the number of bytes of a pixel. */
static inline size_t pixel_of(int bits)
{
    return bits == SAGA_DEPTH ? sizeof(saga_depth) : 3 * (size_t)(bits / 8);
}

/* A picture with rows of width pixels, a gap after each row, and guard bytes
 * around everything. */
typedef struct {
    uint8_t *block;
    size_t nbytes;    /* bytes of the block */
    saga_picture pic; /* the whole picture */
    int width, height;
} picture;

static inline void new_picture(picture *p, int width, int height, int bits,
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

static inline uint8_t *sample_at(const picture *p, int x, int y)
{
    return (uint8_t *)p->pic.rgb + (size_t)y * p->pic.stride_nbytes +
           (size_t)x * pixel_of(p->pic.bits);
}

static inline uint32_t value_at(const picture *p, int x, int y, int k)
{
    const uint8_t *const s = sample_at(p, x, y);
    uint16_t v;

    if (p->pic.bits == 8)
        return s[k];
    memcpy(&v, s + 2 * k, 2);
    return v;
}

/* Returns the part of the picture from pixel (x, y) on, as a job there needs
 * it. */
static inline saga_picture part_at(const picture *p, int x, int y)
{
    saga_picture part = p->pic;

    part.rgb = sample_at(p, x, y);
    part.nbytes -= (size_t)(sample_at(p, x, y) - sample_at(p, 0, 0));
    return part;
}

static inline void exact_picture(picture *p, const scene *s, int bits)
{
    new_picture(p, s->cam.width, s->cam.height, bits, 0);
    if (bits == SAGA_DEPTH)
        ref_depth_exact(&p->pic, &s->cam, s->splats, s->order, s->n);
    else
        ref_blend_exact(&p->pic, &s->cam, s->splats, s->order, s->n);
}

static inline void expect_equal(const picture *got, const picture *want)
{
    const size_t line = (size_t)want->width * pixel_of(want->pic.bits);

    for (int y = 0; y < want->height; y++)
        assert_memory_equal(sample_at(got, 0, y), sample_at(want, 0, y), line);
}

static const int all_bits[] = { 8, 16, SAGA_DEPTH };
enum { N_BITS = sizeof all_bits / sizeof *all_bits };

/* --- Jobs ---------------------------------------------------------------- */

typedef struct {
    int32_t tile;
    uint32_t capacity;
    size_t more; /* bytes of scratch beyond the minimum */
    uint32_t budget;
} setting;

static const setting plain = { 16, 4000, 1 << 16, UINT32_MAX };

static inline void new_job(saga_job *job, const setting *with, int32_t x0,
                           int32_t y0, int32_t x1, int32_t y1)
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

static inline saga_drawing drawing_of(const scene *s)
{
    return (saga_drawing){ &s->cam, s->splats, s->order, s->n, cpu, 0 };
}

/* Calls saga_draw until the job is finished; returns the number of calls. */
static inline uint32_t finish_job(saga_job *job, const saga_picture *pic,
                                  const scene *s, uint32_t budget)
{
    uint32_t calls = 1;

    const saga_drawing d = drawing_of(s);

    while (saga_raster(job, pic, &d, budget) == SAGA_AGAIN)
        calls++;
    assert_ok(saga_raster(job, pic, &d, budget));
    return calls;
}

static inline uint32_t draw_part(const picture *p, const scene *s,
                                 const setting *with, int32_t x0, int32_t y0,
                                 int32_t x1, int32_t y1)
{
    const saga_picture part = part_at(p, x0, y0);
    saga_job job;
    uint32_t calls;

    new_job(&job, with, x0, y0, x1, y1);
    calls = finish_job(&job, &part, s, with->budget);
    free(job.scratch);
    return calls;
}

static inline uint32_t draw(const picture *p, const scene *s,
                            const setting *with)
{
    return draw_part(p, s, with, 0, 0, p->width, p->height);
}

static inline void expect_with(const scene *s, const setting *with,
                               const picture *want)
{
    picture got;

    new_picture(&got, want->width, want->height, want->pic.bits, 0);
    draw(&got, s, with);
    expect_equal(&got, want);
    free(got.block);
}

#endif
