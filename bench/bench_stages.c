/* SPDX-License-Identifier: MIT
 *
 * What a picture takes, stage by stage, in one table: 50,000 splats of random
 * primitives at 640x360, for every set of vectors that the machine has, beside
 * what the machine does at best. Times are CPU time of one thread, the best and
 * the median of 15; a column compares with an earlier result.
 *
 *     bench_stages [OUT.json [BEFORE.json]]
 */
#include "bench_time.h"
#include "depth_sort.h"
#include "gen_scene.h"
#include "raster.h"
#include "splats.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 50000, WIDTH = 640, HEIGHT = 360, TILE = 16, LIST = 1 << 16,
       REPETITIONS = 15, MAX_ROWS = 32, BLOCK = 1 << 26, ADDS = 10000000 };

typedef struct {
    saga_camera cam;
    saga_primitive *prims;
    saga_splat *splats;
    saga_key *keys, *sorted, *tmp;
    uint32_t n_splats;
    saga_picture pic;
    saga_job job;
    saga_cpu cpu;
    uint8_t *from, *to;
} scene;

typedef struct {
    char name[40];
    double best, median, per;    /* ms; of so many things */
    const char *unit;            /* ns each, or what best / per is */
} row;

static row rows[MAX_ROWS];
static int n_rows;

static void *need(size_t nbytes)
{
    void *const p = aligned_alloc(64, (nbytes + 63) & ~(size_t)63);

    if (!p) {
        fprintf(stderr, "out of memory\n");
        exit(1);
    }
    memset(p, 1, nbytes);
    return p;
}

/* --- Stages -------------------------------------------------------------- */

/* One after the other: a cycle each. */
static void add(scene *s)
{
    uint32_t x = s->n_splats;
    int i;

    for (i = 0; i < ADDS; i++) {
        x += 3;
        __asm__ volatile("" : "+r"(x));
    }
}

static void copy(scene *s)
{
    memcpy(s->to, s->from, BLOCK);
}

static void splats(scene *s)
{
    const saga_look look = { &gen_still_format, &s->cam, 32768 };
    uint32_t i;

    s->n_splats = 0;
    for (i = 0; i < N; i += SAGA_RUN) {
        const uint32_t n = N - i < SAGA_RUN ? N - i : SAGA_RUN;
        uint32_t seen = saga_splats(s->splats + s->n_splats, s->prims + i, n,
                                    &look, s->cpu);

        for (; seen != 0; seen &= seen - 1)
            s->n_splats++;
    }
}

static void set_keys(scene *s)
{
    uint32_t i;

    for (i = 0; i < s->n_splats; i++) {
        gen_colour(s->splats[i].colour_q15, i);
        s->keys[i] = (saga_key){ s->splats[i].depth, i };
    }
}

static void sort(scene *s)
{
    memcpy(s->sorted, s->keys, s->n_splats * sizeof *s->keys);
    saga_depth_sort(s->sorted, s->tmp, s->n_splats);
    saga_raster_boxes(s->sorted, s->splats, s->n_splats, &s->cam);
}

static void blend(scene *s)
{
    const saga_drawing d = { &s->cam, s->splats, s->sorted, s->n_splats,
                             s->cpu };

    memset(s->job.cursor, 0, sizeof s->job.cursor);
    if (saga_raster(&s->job, &s->pic, &d, UINT32_MAX) != SAGA_OK)
        exit(1);
}

/* --- The table ----------------------------------------------------------- */

static void measure(const char *name, void (*stage)(scene *), scene *s,
                    double per, const char *unit)
{
    row *const r = rows + n_rows++;
    bench_times times = { .n = 0 };
    int i;

    for (i = 0; i < REPETITIONS; i++) {
        const double start = bench_now_ms();

        stage(s);
        bench_add(&times, bench_now_ms() - start);
    }
    snprintf(r->name, sizeof r->name, "%s", name);
    r->median = bench_median(&times);
    r->best = times.ms[0];
    r->per = per;
    r->unit = unit;
}

static void measure_blend(scene *s, const char *vectors, uint32_t n_tiles,
                          const char *bands)
{
    char name[40];

    s->job.scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) +
                            (n_tiles - 1) * (16u * TILE * TILE + 8u);
    s->job.scratch = need(s->job.scratch_nbytes);
    snprintf(name, sizeof name, "blend, %s, %s", vectors, bands);
    measure(name, blend, s, N, "ns a splat");
    free(s->job.scratch);
}

static void open_scene(scene *s)
{
    gen_rng r = { N };

    memset(s, 0, sizeof *s);
    gen_front_camera(&s->cam, WIDTH, HEIGHT);
    s->prims = need(N * sizeof *s->prims);
    s->splats = need(N * sizeof *s->splats);
    s->keys = need(N * sizeof *s->keys);
    s->sorted = need(N * sizeof *s->sorted);
    s->tmp = need(N * sizeof *s->tmp);
    s->from = need(BLOCK);
    s->to = need(BLOCK);
    gen_uniform_scene(s->prims, N, &r, &s->cam);
    s->pic = (saga_picture){ need(3 * WIDTH * HEIGHT), 3 * WIDTH,
                             3 * WIDTH * HEIGHT, 8 };
    s->job = (saga_job){ .x1 = WIDTH, .y1 = HEIGHT, .tile = TILE,
                         .list_capacity = LIST };
}

static void run(scene *s)
{
    static const char *const vectors[] = { "plain C", "128 bits", "256 bits" };
    const uint32_t all = (WIDTH + TILE - 1) / TILE *
                         ((HEIGHT + TILE - 1) / TILE);
    const saga_cpu best = saga_cpu_best();

    measure("ceiling: additions", add, s, ADDS, "ns each");
    measure("ceiling: memory copied", copy, s, BLOCK, "ns a byte");
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++) {
        char name[40];

        snprintf(name, sizeof name, "animate and project, %s",
                 vectors[s->cpu]);
        measure(name, splats, s, N, "ns a splat");
    }
    set_keys(s);
    measure("sort", sort, s, N, "ns a splat");
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++) {
        measure_blend(s, vectors[s->cpu], all, "one band");
        measure_blend(s, vectors[s->cpu], 1, "bands of a tile");
    }
}

/* Best of a row of an earlier result, 0 if it has none. */
static double before(const char *path, const char *name)
{
    FILE *const f = path ? fopen(path, "r") : NULL;
    char line[200], found[40];
    double best, answer = 0;

    while (f && fgets(line, sizeof line, f))
        if (sscanf(line, " {\"name\": \"%39[^\"]\", \"best_ms\": %lf", found,
                   &best) == 2 && !strcmp(found, name))
            answer = best;
    if (f)
        fclose(f);
    return answer;
}

static void print_table(const char *path)
{
    const double cycle = rows[0].best / ADDS;
    int i;

    printf("%-34s %9s %9s %22s %10s %8s\n", "", "best ms", "median", "",
           "cycles", "before");
    for (i = 0; i < n_rows; i++) {
        const row *const r = rows + i;
        const double old = before(path, r->name);

        printf("%-34s %9.3f %9.3f %11.3f %-10s %10.2f", r->name, r->best,
               r->median, 1e6 * r->best / r->per, r->unit,
               r->best / r->per / cycle);
        if (old > 0)
            printf(" %7.2fx", old / r->best);
        printf("\n");
    }
}

static int write_json(const char *path)
{
    FILE *const f = fopen(path, "w");
    int i;

    if (!f)
        return 0;
    fprintf(f, "[\n");
    for (i = 0; i < n_rows; i++)
        fprintf(f, "  {\"name\": \"%s\", \"best_ms\": %.6f, "
                "\"median_ms\": %.6f, \"count\": %.0f}%s\n", rows[i].name,
                rows[i].best, rows[i].median, rows[i].per,
                i + 1 < n_rows ? "," : "");
    fprintf(f, "]\n");
    return fclose(f) == 0;
}

int main(int argc, char **argv)
{
    scene s;

    open_scene(&s);
    run(&s);
    print_table(argc > 2 ? argv[2] : NULL);
    if (argc > 1 && !write_json(argv[1])) {
        fprintf(stderr, "bench_stages: %s: cannot write\n", argv[1]);
        return 2;
    }
    return 0;
}
