/* SPDX-License-Identifier: MIT
 *
 * This program measures the speed of the trainer's dense networks forward and
 * backward, of its embedding and of Adam.
 */
#include "adam.h"
#include "bench_table.h"
#include "embedding.h"
#include "freed.h"
#include "net.h"
#include "rng.h"

#include <stdio.h>
#include <string.h>

static void report(const saga_net *net, const char *what, bench_times *times,
                   size_t m, double flop)
{
    char name[56];
    bench_row *r;

    snprintf(name, sizeof name, "float %d-%d-%d-%d %s, %zu points", net->dim[0],
             net->dim[1], net->dim[2], net->dim[3], what, m);
    r = bench_row_add(name, times);
    r->count = (double)m;
    r->each = "a point";
    r->kind = BENCH_FLOPS;
    r->work = flop;
}

static void time_network(const saga_net *shape, size_t m, int reps)
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
    double flop = 0;

    memset(&forward, 0, sizeof forward);
    backward = forward;
    if (!saga_net_reserve(&work, &net, m, &error))
        return;
    saga_net_bind(&net, w);
    saga_net_bind(&d, w + n);
    saga_net_init(&net, 1);
    for (size_t i = 0; i < 2 * m * (n_in + n_out); i++)
        x[i] = saga_rng_float(saga_rng_stream(2, 2), i) - 0.5f;
    /* Backward computes two products of matrices where forward computes one. */
    for (int l = 0; l < net.n_layers; l++)
        flop += 2.0 * net.dim[l] * net.dim[l + 1] * (double)m;
    for (int r = 0; r < reps; r++) {
        double at = bench_now_ms();

        saga_net_forward(y, &work, x, m, &net);
        bench_add(&forward, bench_now_ms() - at);
        at = bench_now_ms();
        saga_net_backward(dx, &d, &work, dy, x, m, &net);
        bench_add(&backward, bench_now_ms() - at);
    }
    report(&net, "forward", &forward, m, flop);
    report(&net, "backward", &backward, m, 2 * flop);
    saga_net_free(&work);
    free(w);
    free(x);
}

/* Times the embedding of m points, 4 coordinates in 4 octaves, and Adam on 8
 * parameters a point. */
static void run_rest(size_t m, int reps)
{
    enum { AXES = 4, OCTAVES = 4, PE = 2 * AXES * OCTAVES };
    real *const x = calloc(m * PE, sizeof *x), *const g = x + m * 8;
    real *const m1 = g + m * 8, *const m2 = m1 + m * 8;
    FREED real *const pe = calloc(m * PE, sizeof *pe);
    const saga_adam adam = saga_adam_default();
    const saga_adam_tensor t = { "x", x, g, m1, m2, m * 8, R(0.01) };
    saga_error error = { "" };
    bench_times times[2];
    bench_row *row;

    memset(times, 0, sizeof times);
    for (size_t i = 0; i < m * 16; i++)
        x[i] = saga_rng_float(saga_rng_stream(1, 1), i) - 0.5f;
    for (int r = 0; r < reps; r++) {
        double at = bench_now_ms();

        saga_embedding_forward(pe, PE, x, m, AXES, OCTAVES);
        bench_add(&times[0], bench_now_ms() - at);
        at = bench_now_ms();
        saga_adam_update(&adam, &t, 1, (uint64_t)r + 1, &error);
        bench_add(&times[1], bench_now_ms() - at);
    }
    row = bench_row_add("float embedding, 30000 points", &times[0]);
    row->count = (double)m;
    row->each = "a point";
    row = bench_row_add("Adam, 30000 points of 8", &times[1]);
    row->count = (double)m * 8;
    row->each = "a parameter";
    free(x);
}

void bench_net(void)
{
    static const saga_net big = { .n_layers = 3, .dim = { 64, 64, 64, 32 } };
    static const saga_net small = { .n_layers = 3, .dim = { 56, 32, 32, 23 } };

    time_network(&big, 10000, 21);
    time_network(&big, 100000, 9);
    time_network(&small, 30000, 21);
    run_rest(30000, 21);
}
