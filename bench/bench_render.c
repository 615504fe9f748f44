/* SPDX-License-Identifier: MIT
 *
 * Speed against error of the renderer: CPU time of one thread per stage, and
 * the picture against the float64 reference (saga_raster's pictures are the
 * same for every compiler, so one line of errors serves all builds).
 *
 *     bench_render [REPETITIONS] [TILE] [CPU]
 *
 * CPU: 0 plain C, 1 SSE4.1 or NEON, 2 AVX2; without it the best there is.
 */
#include "animate.h"
#include "depth_sort.h"
#include "gen_scene.h"
#include "project.h"
#include "raster.h"
#include "ref_render.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { MAX_REPETITIONS = 1000, LIST = 1 << 16 };

typedef struct {
    saga_camera cam;
    saga_primitive *primitives;
    saga_splat *splats;
    saga_key *keys, *sorted, *tmp;
    uint32_t n, n_splats;
    saga_picture pic;
    saga_job job;
} scene;

static int repetitions = 21, tile = 16;
static saga_cpu cpu;

static void *need(size_t nbytes)
{
    void *const p = calloc(1, nbytes);

    if (!p) {
        fprintf(stderr, "out of memory\n");
        exit(1);
    }
    return p;
}

static double now_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e3 * (double)t.tv_sec + 1e-6 * (double)t.tv_nsec;
}

static void open_scene(scene *s, uint32_t n, int width, int height)
{
    gen_rng r = { n };

    gen_front_camera(&s->cam, width, height);
    s->n = n;
    s->primitives = need(n * sizeof *s->primitives);
    s->splats = need(n * sizeof *s->splats);
    s->keys = need(n * sizeof *s->keys);
    s->sorted = need(n * sizeof *s->sorted);
    s->tmp = need(n * sizeof *s->tmp);
    gen_uniform_scene(s->primitives, n, &r, &s->cam);
    s->pic.stride_nbytes = (size_t)width * 3;
    s->pic.nbytes = s->pic.stride_nbytes * (size_t)height;
    s->pic.rgb = need(s->pic.nbytes);
    s->pic.bits = 8;
    memset(&s->job, 0, sizeof s->job);
    s->job.x1 = width;
    s->job.y1 = height;
    s->job.tile = tile;
    s->job.list_capacity = LIST;
}

static void close_scene(scene *s)
{
    free(s->primitives);
    free(s->splats);
    free(s->keys);
    free(s->sorted);
    free(s->tmp);
    free(s->pic.rgb);
}

/* --- Stages -------------------------------------------------------------- */

static void project_all(scene *s)
{
    s->n_splats = gen_splats(s->splats, NULL, s->primitives, &gen_still_format,
                             s->n, &s->cam, 32768);
}

static void sort_all(scene *s)
{
    uint32_t i;

    for (i = 0; i < s->n_splats; i++) {
        s->sorted[i].depth = s->splats[i].depth;
        s->sorted[i].index = i;
    }
    saga_depth_sort(s->sorted, s->tmp, s->n_splats);
    saga_raster_boxes(s->sorted, s->splats, s->n_splats, &s->cam);
}

static void blend_all(scene *s)
{
    const saga_drawing drawing = { &s->cam, s->splats, s->sorted, s->n_splats,
                                   cpu };

    memset(s->job.cursor, 0, sizeof s->job.cursor);
    if (saga_raster(&s->job, &s->pic, &drawing, UINT32_MAX) != SAGA_OK) {
        fprintf(stderr, "raster failed\n");
        exit(1);
    }
}

static int by_value(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return x < y ? -1 : x > y;
}

/* Prints min and median over the repetitions, ms, and ns per unit. */
static void measure(const char *name, void (*stage)(scene *), scene *s,
                    double units)
{
    double ms[MAX_REPETITIONS];
    int i;

    for (i = 0; i < repetitions; i++) {
        const double start = now_ms();

        stage(s);
        ms[i] = now_ms() - start;
    }
    qsort(ms, (size_t)repetitions, sizeof *ms, by_value);
    printf("  %-28s min %7.2f ms  median %7.2f ms  (%.1f ns per splat)\n",
           name, ms[0], ms[repetitions / 2], 1e6 * ms[0] / units);
}

/* Scratch for the band of n_tiles tiles. */
static void set_scratch(scene *s, size_t n_tiles)
{
    const size_t one = SAGA_JOB_NBYTES(tile, 0);

    free(s->job.scratch);
    s->job.scratch_nbytes = n_tiles * one + 8 * (size_t)LIST;
    s->job.scratch = need(s->job.scratch_nbytes);
}

/* --- Error --------------------------------------------------------------- */

static void report_error(scene *s)
{
    ref_splat *const ref = need(s->n * sizeof *ref);
    uint32_t *const order = need(s->n * sizeof *order);
    double *const rgb = need(s->pic.nbytes * sizeof *rgb);
    double steps, psnr;
    ref_primitive still;
    ref_animated a;
    uint32_t i, k, n = 0;

    for (i = 0; i < s->n; i++) {
        ref_primitive_of(&still, s->primitives + i, &gen_still_format);
        ref_animate(&a, &still, 0.5);
        if (!ref_project(ref + n, &a, &s->cam))
            continue;
        uint16_t colour[3];
        gen_colour(colour, i);
        for (k = 0; k < 3; k++)
            ref[n].colour[k] = colour[k] / 32768.0;
        n++;
    }
    ref_sort(order, ref, n);
    ref_blend(rgb, &s->cam, ref, order, n);
    psnr = ref_psnr(&s->pic, &s->cam, rgb, &steps);
    printf("  against float64: %.2f dB, largest difference %.2f of 255\n",
           psnr, steps);
    free(ref);
    free(order);
    free(rgb);
}

static void report_scene(const scene *s)
{
    double half = 0, pixels = 0;
    uint32_t i;

    for (i = 0; i < s->n_splats; i++) {
        const saga_splat *const p = s->splats + i;

        half += (p->x1 - p->x0 + p->y1 - p->y0) / 4.0;
        pixels += (double)(p->x1 - p->x0) * (p->y1 - p->y0);
    }
    printf("%u primitives, %ux%u: %u splats, mean half-extent %.1f px, "
           "%.0f px per box\n", s->n, s->cam.width, s->cam.height, s->n_splats,
           half / s->n_splats, pixels / s->n_splats);
}

static void bench(uint32_t n, int width, int height)
{
    scene s;

    open_scene(&s, n, width, height);
    project_all(&s);
    report_scene(&s);
    measure("animate and project", project_all, &s, n);
    measure("sort", sort_all, &s, n);
    set_scratch(&s, 1);
    measure("blend, bands of one tile", blend_all, &s, n);
    set_scratch(&s, (size_t)((width + tile - 1) / tile));
    measure("blend, bands of a row", blend_all, &s, n);
    set_scratch(&s, (size_t)((width + tile - 1) / tile) *
                    (size_t)((height + tile - 1) / tile));
    measure("blend, one band", blend_all, &s, n);
    report_error(&s);
    free(s.job.scratch);
    close_scene(&s);
}

int main(int argc, char **argv)
{
    if (argc > 1)
        repetitions = atoi(argv[1]);
    if (argc > 2)
        tile = atoi(argv[2]);
    cpu = argc > 3 ? (saga_cpu)atoi(argv[3]) : saga_cpu_best();
    if (cpu > saga_cpu_best() || repetitions < 1 ||
        repetitions > MAX_REPETITIONS)
        return 2;
    printf("tile %d, %d repetitions, cpu %d\n", tile, repetitions,
           (int)cpu);
    bench(20000, 640, 360);
    bench(50000, 640, 360);
    return 0;
}
