/* SPDX-License-Identifier: MIT
 *
 * What a picture takes, stage by stage and as a whole, in one table: 50,000
 * splats of random primitives at 640x360 and a colour network of 32 hidden
 * units, for every set of vectors that the machine has. Times are CPU time of
 * one thread, best and median of 15. Columns tell them in the machine's own
 * units, too: cycles of the clock, as a chain of additions finds it, and copies
 * of 64 MiB of memory; and beside what is wanted, and an earlier result.
 *
 *     bench_stages [OUT.json [BEFORE.json]]
 */
#include "animate.h"
#include "bench_time.h"
#include "depth_sort.h"
#include "gen_scene.h"
#include "raster.h"
#include "reconstruct.h"
#include "splats.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { N = 50000, WIDTH = 640, HEIGHT = 360, TILE = 16, LIST = 1 << 16,
       REPETITIONS = 15, MAX_ROWS = 32, BLOCK = 1 << 26, ADDS = 10000000,
       HIDDEN = 32 };

typedef struct {
    saga_camera cam;
    saga_primitive *prims;
    saga_splat *splats;
    saga_key *keys, *sorted, *tmp;
    uint32_t n_splats;
    saga_model model;
    saga_nets nets;
    saga_scaffold sc;
    int16_t *base;               /* (N, HIDDEN) of the colours */
    saga_picture pic;
    saga_job job;
    saga_cpu cpu;
    uint8_t *from, *to;
} scene;

typedef struct {
    char name[40];
    double best, median, per;    /* ms; of so many things */
    const char *unit;            /* ns each, or what best / per is */
    double wanted;               /* ms, or 0 */
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

/* As in a view: positions at the middle of the segment, directions, the last
 * layers of the colour's network. Its weights are zero, which takes as long. */
static void colour(scene *s)
{
    const uint32_t most = saga_shade_points(&s->sc);
    saga_seen seen;
    uint32_t i, k;

    s->sc.net.cpu = s->cpu;
    for (i = 0; i < s->n_splats; i += seen.n) {
        seen.n = s->n_splats - i < most ? s->n_splats - i : most;
        for (k = 0; k < seen.n; k++) {
            seen.base[k] = s->base + (size_t)HIDDEN * (i + k);
            saga_animate_mean(seen.x[k], s->prims + i + k, &gen_still_format,
                              32768);
        }
        saga_shade(s->splats + i, &s->sc, &seen, s->cam.centre);
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

static void picture(scene *s)
{
    splats(s);
    colour(s);
    sort(s);
    blend(s);
}

/* --- The table ----------------------------------------------------------- */

static row *measure(const char *name, void (*stage)(scene *), scene *s,
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
    return r;
}

/* A stage of this name with the vectors s->cpu. */
static row *measure_with(const char *name, void (*stage)(scene *), scene *s)
{
    static const char *const vectors[] = { "plain C", "128 bits", "256 bits" };
    char both[40];

    snprintf(both, sizeof both, "%s, %s", name, vectors[s->cpu]);
    return measure(both, stage, s, N, "ns a splat");
}

static void set_bands(scene *s, uint32_t n_tiles)
{
    free(s->job.scratch);
    s->job.scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) +
                            (n_tiles - 1) * (16u * TILE * TILE + 8u);
    s->job.scratch = need(s->job.scratch_nbytes);
}

static void open_colours(scene *s)
{
    s->model.tools = SAGA_TOOL_VIEW;
    s->model.features = 16;
    s->model.octaves = 4;
    s->model.width[SAGA_NET_COLOUR] = HIDDEN;
    s->model.q_in[SAGA_NET_COLOUR_VIEW] = 14;
    s->model.head_q[SAGA_HEAD_COLOUR] = 12;
    saga_nets_layout(&s->nets, &s->model);
    s->sc.model = &s->model;
    s->sc.net.nets = &s->nets;
    s->sc.net.params = memset(need(s->nets.nbytes), 0, s->nets.nbytes);
    s->sc.net.v = need(sizeof *s->sc.net.v);
    s->base = need(N * HIDDEN * sizeof *s->base);
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
    const uint32_t all = (WIDTH + TILE - 1) / TILE *
                         ((HEIGHT + TILE - 1) / TILE);
    static const double pictures[] = { 50, 0, 16.7 };
    const saga_cpu best = saga_cpu_best();

    measure("ceiling: additions", add, s, ADDS, "ns each");
    measure("ceiling: memory copied", copy, s, BLOCK, "ns a byte");
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++)
        measure_with("animate and project", splats, s)->wanted =
            s->cpu == SAGA_CPU_AVX2 ? N * 60e-6 : 0;
    set_keys(s);
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++)
        measure_with("view colour", colour, s);
    measure("sort", sort, s, N, "ns a splat");
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++) {
        double whole;

        set_bands(s, all);
        whole = measure_with("blend", blend, s)->best;
        measure_with("picture", picture, s)->wanted = pictures[s->cpu];
        set_bands(s, 1);
        measure_with("bands of a tile", blend, s)->wanted = 2 * whole;
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

    printf("%-31s %8s %8s %8s %21s %8s %8s %8s\n", "", "best ms", "median",
           "wanted", "", "cycles", "copies", "before");
    for (i = 0; i < n_rows; i++) {
        const row *const r = rows + i;
        const double old = before(path, r->name);

        printf("%-31s %8.3f %8.3f", r->name, r->best, r->median);
        if (r->wanted > 0)
            printf(" %8.3f", r->wanted);
        else
            printf(" %8s", "");
        printf(" %10.3f %-10s %8.2f %8.3f", 1e6 * r->best / r->per, r->unit,
               r->best / r->per / cycle, r->best / rows[1].best);
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
                "\"median_ms\": %.6f, \"count\": %.0f, \"cycles\": %.3f, "
                "\"wanted_ms\": %.3f}%s\n", rows[i].name, rows[i].best,
                rows[i].median, rows[i].per,
                rows[i].best / rows[i].per / (rows[0].best / ADDS),
                rows[i].wanted, i + 1 < n_rows ? "," : "");
    fprintf(f, "]\n");
    return fclose(f) == 0;
}

int main(int argc, char **argv)
{
    scene s;

    open_scene(&s);
    open_colours(&s);
    run(&s);
    print_table(argc > 2 ? argv[2] : NULL);
    if (argc > 1 && !write_json(argv[1])) {
        fprintf(stderr, "bench_stages: %s: cannot write\n", argv[1]);
        return 2;
    }
    return 0;
}
