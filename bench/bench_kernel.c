/* SPDX-License-Identifier: MIT
 *
 * Kernel interpolation (K = 8 of 64 features), embedding and Adam: CPU
 * milliseconds of one thread, median (min). bench_kernel [repetitions]
 */
#include "adam.h"
#include "bench_time.h"
#include "embedding.h"
#include "kernel_interp.h"
#include "rng.h"

#include <stdio.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

enum { K = 8, F = 64, OCTAVES = 4, PE = 8 * OCTAVES };

static real *reals(size_t n, uint64_t stream, real lo, real hi)
{
    real *const x = malloc(n * sizeof *x);
    size_t i;

    for (i = 0; i < n; i++)
        x[i] = lo + (hi - lo) * R(saga_rng_float(saga_rng_stream(1, stream),
                                                 i));
    return x;
}

static void show(const char *what, bench_times *t)
{
    printf(", %s %.2f", what, bench_median(t));
    printf(" (%.2f)", t->ms[0]);
}

static void run(size_t m, int reps)
{
    const size_t b = m / 5;
    uint32_t *const index = malloc(m * (K + 1) * sizeof *index);
    uint32_t *const count = index + m * K;
    const saga_kernel k = { m, b, F, K, index, count, R(0.5), 1 };
    const saga_kernel_values v = {
        reals(b * F, 1, -1, 1), reals(b * 4, 2, -1, 1), reals(b * 4, 3, 1, 2),
        reals(m * 4, 4, -1, 1), reals(m * 4, 5, 1, 2)
    };
    saga_kernel_values d = {
        reals(b * F, 1, 0, 0), reals(b * 4, 2, 0, 0), reals(b * 4, 3, 0, 0),
        NULL, NULL
    };
    real *const out = reals(m * F, 6, 0, 0), *const dy = reals(m * F, 7, -1, 1);
    real *const pe = reals(m * PE, 8, 0, 0), *const x = reals(m * 14, 9, 0, 1);
    real *const m1 = reals(m * 14, 9, 0, 0), *const m2 = reals(m * 14, 9, 0, 0);
    const saga_adam adam = saga_adam_default();
    const saga_adam_tensor t = { "x", x, dy, m1, m2, m * 14, R(0.01) };
    saga_adam_fault fault;
    saga_kernel_work work = { 0 };
    bench_times times[5];
    size_t i;
    int r;

    memset(times, 0, sizeof times);
    for (i = 0; i < m * K; i++)
        index[i] = (uint32_t)((i / K / 5 + i % K) % b);
    for (i = 0; i < m; i++)
        count[i] = K;
    saga_kernel_link(&work, &k);
    for (r = 0; r < reps; r++) {
        double at = bench_now_ms();

        saga_kernel_forward(out, &work, &v, &k);
        bench_add(&times[0], bench_now_ms() - at);
        at = bench_now_ms();
        saga_kernel_backward(&d, &work, dy, &v, &k);
        bench_add(&times[1], bench_now_ms() - at);
        at = bench_now_ms();
        saga_embedding_forward(pe, PE, v.query, m, 4, OCTAVES);
        bench_add(&times[2], bench_now_ms() - at);
        at = bench_now_ms();
        saga_embedding_backward(out, dy, pe, PE, m, 4, OCTAVES);
        bench_add(&times[3], bench_now_ms() - at);
        at = bench_now_ms();
        saga_adam_step(&fault, &adam, &t, 1, (uint64_t)r + 1);
        bench_add(&times[4], bench_now_ms() - at);
    }
    printf("%zu points", m);
    show("interpolation", &times[0]);
    show("backward (features and sources)", &times[1]);
    show("embedding", &times[2]);
    show("backward", &times[3]);
    show("Adam of 14 reals each", &times[4]);
    printf(" ms\n");
}

int main(int argc, char **argv)
{
    const int reps = argc > 1 ? atoi(argv[1]) : 21;

#ifdef _OPENMP
    omp_set_num_threads(1);
#endif
    run(10000, reps);
    run(30000, reps);
    return 0;
}
