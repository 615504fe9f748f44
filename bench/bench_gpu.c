/* SPDX-License-Identifier: MIT
 *
 * The time of an iteration on a GPU, if there is one: of the warm-up; of a
 * picture of the host's primitives; and of the rendering stage with all that
 * the host does in it; with the times of the kernels. Processors that take the
 * place of a GPU are left out.
 */
#include "bench_capture.h"
#include "bench_table.h"
#include "clock.h"
#include "flat_state.h"
#include "freed.h"
#include "gpu_splat.h"
#include "train.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { FIRST = 20, N_RUNS = 60 };

/* The clock's time, since the device computes, not this thread. */
static double now_ms(void)
{
    return 1e3 * saga_clock_seconds();
}

static void fail(const saga_error *e)
{
    fprintf(stderr, "bench_table: %s\n", e->message);
    exit(1);
}

static void add_row(bench_times *t, const char *name, int n, int width,
                    int height)
{
    char all[56];
    bench_row *r;

    snprintf(all, sizeof all, "GPU %s, %dx%d", name, width, height);
    r = bench_row_add(all, t);
    r->count = n;
    r->each = "a primitive";
}

/* Tells the time of each kernel in an iteration of a stage. */
static void print_kernels(const char *stage, saga_gpu *gpu, int n, int width,
                          int height)
{
    printf("  %s, %d primitives, %dx%d on %s\n", stage, n, width, height,
           saga_gpu_is(gpu)->name);
    for (int k = 0; k < SAGA_N_KERNELS; k++) {
        uint64_t runs;
        const double s = saga_gpu_seconds(gpu, k, &runs);

        if (runs > 0)
            printf("    %-15s %6.3f ms in %.1f runs\n",
                   saga_gpu_kernels[k].name, 1e3 * s / N_RUNS,
                   (double)runs / N_RUNS);
    }
}

static void time_warm_up(saga_flat *f, int n, int width, int height)
{
    bench_times t = { 0 };
    saga_error e = { "" };
    double mse;

    for (int i = 0; i < FIRST + N_RUNS; i++) {
        const double start = now_ms();

        if (i == FIRST)
            saga_gpu_time(f->o.gpu, true);
        if (!saga_flat_iterate(f, &mse, &e))
            fail(&e);
        if (i >= FIRST)
            bench_add(&t, now_ms() - start);
    }
    add_row(&t, "warm-up", n, width, height);
    print_kernels("warm-up", f->o.gpu, n, width, height);
    saga_gpu_time(f->o.gpu, false);
}

/* Times a picture of the host's primitives, as the rendering stage draws it
 * where primitives share anchors. */
static void time_picture(saga_flat *f, int n, int width, int height)
{
    const saga_sample sample = { .view = f->pictures->train[0], .frame = 1 };
    saga_splat_learning l = { .d = f->grad };
    bench_times t = { 0 };
    saga_error e = { "" };

    if (!saga_flat_bring(f, &e))
        fail(&e);
    for (int i = 0; i < FIRST + N_RUNS; i++) {
        const double start = now_ms();

        if (!saga_gpu_show(f->gpu, &f->canvas, sample, &e) ||
            !saga_gpu_learn(f->gpu, &l, &f->canvas, &f->value, f->n, &e))
            fail(&e);
        if (i >= FIRST)
            bench_add(&t, now_ms() - start);
    }
    add_row(&t, "picture", n, width, height);
}

/* --- The rendering stage -------------------------------------------------- */

/* Features are rounded in the last third of the stage, which is not timed, nor
 * are the first iterations. */
enum { N_WARM = 40, N_RENDER = (FIRST + N_RUNS) * 3 / 2 };

typedef struct {
    saga_gpu *gpu;
    bench_times times;
    double start;
} stopwatch;

/* Notes the time since the previous iteration, and begins the next one. */
static bool lap(void *user, const saga_train_progress *p)
{
    stopwatch *const w = user;

    if (p->stage == SAGA_TRAIN_WARM)
        return true;
    if (p->iteration >= FIRST)
        bench_add(&w->times, now_ms() - w->start);
    if (p->iteration + 1 == FIRST)
        saga_gpu_time(w->gpu, true);
    w->start = now_ms();
    return p->iteration + 1 < FIRST + N_RUNS;
}

static void time_rendering(saga_gpu *gpu, const saga_capture *c, int n,
                           int width, int height)
{
    stopwatch w = { .gpu = gpu };
    saga_error e = { "" };
    const saga_train_options o = { .n_segments = 1,
                                   .n_primitives = (uint32_t)n,
                                   .n_iterations = N_WARM + N_RENDER,
                                   .n_warm = N_WARM,
                                   .n_render = N_RENDER,
                                   .level = 3,
                                   .n_layers = 1,
                                   .seed = 1,
                                   .motion = SAGA_TRAIN_MOVING,
                                   .gpu = gpu,
                                   .progress = lap,
                                   .progress_user = &w };
    saga_train *const t = saga_train_new(c, &o, &e);

    if (!t || saga_train_run(t, &e) != SAGA_STOPPED)
        fail(&e);
    saga_train_free(t);
    add_row(&w.times, "rendering", n, width, height);
    print_kernels("rendering", gpu, n, width, height);
    saga_gpu_time(gpu, false);
}

static void time_size(saga_gpu *gpu, int n, int width, int height)
{
    FREED_BY(saga_capture_free)
    saga_capture c = bench_capture(width, height);
    saga_flat_options o = saga_flat_defaults();
    saga_error e = { "" };
    saga_pictures p;
    saga_flat *f = NULL;

    o.n_primitives = (uint32_t)n;
    o.n_iterations = 40000; /* so that their number does not change here */
    o.coarse = 0;
    o.gpu = gpu;
    if (!saga_pictures_init(&p, &c, &e) || !(f = saga_flat_new(&p, &o, &e)))
        fail(&e);
    time_warm_up(f, n, width, height);
    time_picture(f, n, width, height);
    saga_flat_free(f);
    saga_pictures_free(&p);
    time_rendering(gpu, &c, n, width, height);
}

void bench_gpu(void)
{
    saga_gpu_info list[8];
    saga_error e = { "" };
    const int n = saga_gpu_list(list, 8, &e);

    for (int i = 0; i < n && i < 8; i++) {
        saga_gpu *gpu;

        if (list[i].lacks || !strcmp(list[i].kind, "cpu"))
            continue;
        gpu = saga_gpu_open(i, &e);
        if (!gpu)
            fail(&e);
        time_size(gpu, 15000, 480, 270);
        time_size(gpu, 100000, 1352, 1014);
        saga_gpu_close(gpu);
        return;
    }
    printf("no GPU: its rows are left out\n");
}
