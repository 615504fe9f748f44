/* SPDX-License-Identifier: MIT
 *
 * The time of an iteration of each stage of a training, with one thread and
 * with two, at the size of the demo's pictures and at the paper's. The times
 * are those of the calling thread, which works in every parallel region.
 */
#include "bench_capture.h"
#include "bench_table.h"
#include "freed.h"
#include "train.h"

#include <stdio.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#else
#define omp_set_num_threads(n) (void)(n)
#endif

/* Whole pictures are drawn in the last part of the warm-up only. In the
 * rendering stage, the first iteration starts the entropy model, and the
 * features are rounded from N_NOISE iterations on. */
enum { N_WARM = 24, FIRST_WARM = 12, N_RENDER = 21, FIRST_RENDER = 2 };
enum { N_NOISE = N_RENDER * 2 / 3, MOST_THREADS = 2 };

typedef struct {
    bench_times times[SAGA_TRAIN_N_STAGES][MOST_THREADS];
    double start;
} stopwatch;

/* Notes the time since the previous iteration, and begins the next one with the
 * other number of threads. Stops when features are rounded. */
static bool lap(void *user, const saga_train_progress *p)
{
    stopwatch *const w = user;
    const int first = p->stage == SAGA_TRAIN_WARM ? FIRST_WARM : FIRST_RENDER;
    const int done = p->iteration % MOST_THREADS;
    const int next = (p->iteration + 1) % MOST_THREADS;

    if (p->iteration >= first)
        bench_add(&w->times[p->stage][done], bench_now_ms() - w->start);
    omp_set_num_threads(next + 1);
    w->start = bench_now_ms();
    return p->stage == SAGA_TRAIN_WARM || p->iteration + 1 < N_NOISE;
}

static void fail(const saga_error *e)
{
    fprintf(stderr, "bench_table: %s\n", e->message);
    exit(1);
}

static void time_training(int n, int width, int height)
{
    static const char *const stage[] = { "warm-up", "rendering" };
    FREED_BY(saga_capture_free) saga_capture c = bench_capture(width, height);
    stopwatch w = { .start = bench_now_ms() };
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
                                   .progress = lap,
                                   .progress_user = &w };
    saga_train *const t = saga_train_new(&c, &o, &e);

    if (!t || saga_train_run(t, &e) != SAGA_STOPPED)
        fail(&e);
    saga_train_free(t);
    omp_set_num_threads(1);
    for (int s = 0; s < SAGA_TRAIN_PACK; s++)
        for (int k = 0; k < MOST_THREADS; k++) {
            char name[56];
            bench_row *r;

            snprintf(name, sizeof name, "%s, %dx%d, %d thread%s", stage[s],
                     width, height, k + 1, k ? "s" : "");
            r = bench_row_add(name, &w.times[s][k]);
            r->count = n;
            r->each = "a primitive";
        }
}

void bench_train(void)
{
    time_training(15000, 480, 270);
    time_training(100000, 1352, 1014);
}
