/* SPDX-License-Identifier: MIT
 *
 * The time to draw a picture, stage by stage and as a whole, with every set of
 * vector instructions that the machine has. The picture has 640x360 pixels and
 * 50,000 splats of random primitives; the colour network has 32 hidden units.
 */
#include "animate.h"
#include "bench_table.h"
#include "depth_sort.h"
#include "gen_scene.h"
#include "raster.h"
#include "reconstruct.h"
#include "splats.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum {
    N = 50000,
    WIDTH = 640,
    HEIGHT = 360,
    TILE = 16,
    LIST = 1 << 16,
    HIDDEN = 32
};

typedef struct {
    saga_camera cam;
    saga_primitive *prims;
    saga_splat *splats;
    saga_key *keys, *sorted, *tmp;
    uint32_t n_splats;
    saga_model model;
    saga_nets nets;
    saga_scaffold sc;
    int16_t *base; /* (N, HIDDEN) of the colours */
    saga_picture pic;
    saga_job job;
    saga_cpu cpu;
} scene;

/* --- Stages -------------------------------------------------------------- */

static void splats(void *data)
{
    scene *const s = data;
    const saga_look look = { &gen_still_format, &s->cam, 32768 };

    s->n_splats = 0;
    for (uint32_t i = 0; i < N; i += SAGA_RUN) {
        const uint32_t n = N - i < SAGA_RUN ? N - i : SAGA_RUN;
        uint32_t seen = saga_splats(s->splats + s->n_splats, s->prims + i, n,
                                    &look, s->cpu);

        for (; seen != 0; seen &= seen - 1)
            s->n_splats++;
    }
}

static void set_keys(scene *s)
{
    for (uint32_t i = 0; i < s->n_splats; i++) {
        gen_colour(s->splats[i].colour_q15, i);
        s->keys[i] = (saga_key){ s->splats[i].depth, i };
    }
}

/* Computes colours as saga_view does: positions at the middle of the segment,
 * directions, and the last layers of the colour network. Its weights are zero;
 * the time does not depend on them. */
static void colour(void *data)
{
    scene *const s = data;
    const uint32_t most = saga_shade_points(&s->sc);
    saga_seen seen;

    s->sc.net.cpu = s->cpu;
    for (uint32_t i = 0; i < s->n_splats; i += seen.n) {
        seen.n = s->n_splats - i < most ? s->n_splats - i : most;
        for (uint32_t k = 0; k < seen.n; k++) {
            seen.base[k] = s->base + (size_t)HIDDEN * (i + k);
            saga_animate_mean(seen.x[k], s->prims + i + k, &gen_still_format,
                              32768);
        }
        saga_shade(s->splats + i, &s->sc, &seen, s->cam.centre);
    }
}

static void sort(void *data)
{
    scene *const s = data;
    memcpy(s->sorted, s->keys, s->n_splats * sizeof *s->keys);
    saga_depth_sort(s->sorted, s->tmp, s->n_splats);
    (void)saga_raster_boxes(s->sorted, s->splats, s->n_splats, &s->cam);
}

static void blend(void *data)
{
    scene *const s = data;
    const saga_drawing d = { &s->cam,     s->splats, s->sorted,
                             s->n_splats, s->cpu,    0 };

    memset(s->job.cursor, 0, sizeof s->job.cursor);
    if (saga_raster(&s->job, &s->pic, &d, UINT32_MAX) != SAGA_OK)
        exit(1);
}

static void picture(void *data)
{
    scene *const s = data;
    splats(s);
    colour(s);
    sort(s);
    blend(s);
}

/* Times a stage with the vector instructions s->cpu, and adds its row. */
static bench_row *measure(const char *name, void (*stage)(void *), scene *s)
{
    static const char *const vectors[] = { "plain C", "128 bits", "256 bits" };
    char both[40];
    bench_row *r;

    snprintf(both, sizeof both, "%s, %s", name, vectors[s->cpu]);
    r = bench_measure(both, stage, s);
    r->count = N;
    r->each = "a splat";
    return r;
}

static void set_bands(scene *s, uint32_t n_tiles)
{
    free(s->job.scratch);
    s->job.scratch_nbytes = SAGA_JOB_NBYTES(TILE, LIST) +
                            (n_tiles - 1) * (16u * TILE * TILE + 8u);
    s->job.scratch = bench_need(s->job.scratch_nbytes);
}

static void open_colours(scene *s)
{
    s->model.tools = SAGA_TOOL_VIEW;
    s->model.features = 16;
    s->model.octaves = 4;
    s->model.width[SAGA_NET_COLOUR] = HIDDEN;
    s->model.q_in[SAGA_NET_COLOUR_VIEW] = 14;
    s->model.out_q[SAGA_OUT_COLOUR] = 12;
    saga_nets_layout(&s->nets, &s->model);
    s->sc.model = &s->model;
    s->sc.net.nets = &s->nets;
    s->sc.net.params = memset(bench_need(s->nets.nbytes), 0, s->nets.nbytes);
    s->sc.net.v = bench_need(sizeof *s->sc.net.v);
    s->base = bench_need(N * HIDDEN * sizeof *s->base);
}

static void open_scene(scene *s)
{
    gen_rng r = { N };

    memset(s, 0, sizeof *s);
    gen_front_camera(&s->cam, WIDTH, HEIGHT);
    s->prims = bench_need(N * sizeof *s->prims);
    s->splats = bench_need(N * sizeof *s->splats);
    s->keys = bench_need(N * sizeof *s->keys);
    s->sorted = bench_need(N * sizeof *s->sorted);
    s->tmp = bench_need(N * sizeof *s->tmp);
    gen_uniform_scene(s->prims, N, &r, &s->cam);
    s->pic = (saga_picture){ bench_need(3 * WIDTH * HEIGHT), 3 * WIDTH,
                             3 * WIDTH * HEIGHT, 8 };
    s->job = (saga_job){
        .x1 = WIDTH, .y1 = HEIGHT, .tile = TILE, .list_capacity = LIST
    };
}

static void time_stages(scene *s)
{
    const uint32_t all = (WIDTH + TILE - 1) / TILE *
                         ((HEIGHT + TILE - 1) / TILE);
    static const double pictures[] = { 50, 0, 16.7 };
    const saga_cpu best = saga_cpu_best();

    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++)
        measure("animate and project", splats, s)->wanted =
            s->cpu == SAGA_CPU_AVX2 ? N * 60e-6 : 0;
    set_keys(s);
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++)
        measure("view colour", colour, s);
    s->cpu = SAGA_CPU_PLAIN;
    snprintf(measure("sort", sort, s)->name, sizeof "sort", "sort");
    /* The picture is drawn with scratch memory for all tiles at once, then for
     * a single tile. */
    for (s->cpu = SAGA_CPU_PLAIN; s->cpu <= best; s->cpu++) {
        double whole;

        set_bands(s, all);
        whole = measure("blend", blend, s)->best;
        measure("picture", picture, s)->wanted = pictures[s->cpu];
        set_bands(s, 1);
        measure("bands of a tile", blend, s)->wanted = 2 * whole;
    }
}

void bench_stages(void)
{
    scene s;

    open_scene(&s);
    open_colours(&s);
    time_stages(&s);
}
