/* SPDX-License-Identifier: MIT
 *
 * Network 64-64-64-32, forward and backward: CPU milliseconds of one thread,
 * median (min), and GFLOP/s; embedding and Adam. bench_net [repetitions]
 */
#include "adam.h"
#include "bench_time.h"
#include "embedding.h"
#include "net.h"
#include "rng.h"

#include <stdio.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

static void run(const saga_net *shape, size_t m, int reps)
{
    saga_net net = *shape, d = *shape;
    const size_t n_in = (size_t)net.dim[0];
    const size_t n_out = (size_t)net.dim[net.n_layers];
    const size_t n = saga_net_n_params(&net);
    real *const w = calloc(2 * n, sizeof *w);
    real *const x = calloc(2 * m * (n_in + n_out), sizeof *x);
    real *const dx = x + m * n_in, *const y = dx + m * n_in;
    real *const dy = y + m * n_out;
    saga_error error = { "" };
    saga_net_work work;
    bench_times forward, backward;
    double gflop = 0;
    size_t i;
    int r, l;

    memset(&forward, 0, sizeof forward);
    backward = forward;
    if (!saga_net_reserve(&work, &net, m, &error))
        return;
    saga_net_bind(&net, w);
    saga_net_bind(&d, w + n);
    saga_net_init(&net, 1);
    for (i = 0; i < 2 * m * (n_in + n_out); i++)
        x[i] = saga_rng_float(saga_rng_stream(2, 2), i) - 0.5f;
    for (l = 0; l < net.n_layers; l++)
        gflop += 2e-9 * net.dim[l] * net.dim[l + 1] * (double)m;
    for (r = 0; r < reps; r++) {
        double at = bench_now_ms();

        saga_net_forward(y, &work, x, m, &net);
        bench_add(&forward, bench_now_ms() - at);
        at = bench_now_ms();
        saga_net_backward(dx, &d, &work, dy, x, m, &net);
        bench_add(&backward, bench_now_ms() - at);
    }
    printf("%d-%d-...-%d, %6zu points: forward", net.dim[0], net.dim[1],
           net.dim[net.n_layers], m);
    printf(" %.2f", bench_median(&forward));
    printf(" (%.2f) ms, %.0f (%.0f) GFLOP/s; backward", forward.ms[0],
           gflop / bench_median(&forward) * 1e3, gflop / forward.ms[0] * 1e3);
    printf(" %.2f", bench_median(&backward));
    printf(" (%.2f) ms, %.0f (%.0f) GFLOP/s\n", backward.ms[0],
           2 * gflop / bench_median(&backward) * 1e3,
           2 * gflop / backward.ms[0] * 1e3);
    saga_net_free(&work);
    free(w);
    free(x);
}

/* m points of 4 coordinates in 4 octaves; 8 parameters a point. */
static void run_rest(size_t m, int reps)
{
    enum { AXES = 4, OCTAVES = 4, PE = 2 * AXES * OCTAVES };
    real *const x = calloc(m * PE, sizeof *x), *const g = x + m * 8;
    real *const m1 = g + m * 8, *const m2 = m1 + m * 8;
    real *const pe = calloc(m * PE, sizeof *pe);
    const saga_adam adam = saga_adam_default();
    const saga_adam_tensor t = { "x", x, g, m1, m2, m * 8, R(0.01) };
    saga_error error = { "" };
    bench_times times[2];
    size_t i;
    int r;

    memset(times, 0, sizeof times);
    for (i = 0; i < m * 16; i++)
        x[i] = saga_rng_float(saga_rng_stream(1, 1), i) - 0.5f;
    for (r = 0; r < reps; r++) {
        double at = bench_now_ms();

        saga_embedding_forward(pe, PE, x, m, AXES, OCTAVES);
        bench_add(&times[0], bench_now_ms() - at);
        at = bench_now_ms();
        saga_adam_update(&adam, &t, 1, (uint64_t)r + 1, &error);
        bench_add(&times[1], bench_now_ms() - at);
    }
    printf("%zu points: embedding %.2f", m, bench_median(&times[0]));
    printf(" (%.2f) ms, Adam of 8 reals each", times[0].ms[0]);
    printf(" %.2f", bench_median(&times[1]));
    printf(" (%.2f) ms\n", times[1].ms[0]);
    free(x);
    free(pe);
}

int main(int argc, char **argv)
{
    static const saga_net big = { .n_layers = 3, .dim = { 64, 64, 64, 32 } };
    static const saga_net small = { .n_layers = 3, .dim = { 56, 32, 32, 23 } };
    const int reps = argc > 1 ? atoi(argv[1]) : 21;

#ifdef _OPENMP
    omp_set_num_threads(1);
#endif
    run(&big, 10000, reps);
    run(&big, 30000, reps);
    run(&big, 100000, reps > 9 ? 9 : reps);
    run(&small, 30000, reps);
    run_rest(30000, reps);
    return 0;
}
