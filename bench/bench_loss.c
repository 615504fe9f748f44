/* SPDX-License-Identifier: MIT
 *
 * Mean squared error with gradient: CPU milliseconds of one thread, median
 * (min).
 * bench_loss [repetitions]
 */
#include "bench_time.h"
#include "picture_loss.h"
#include "rng.h"

#include <stdio.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#endif

static void run(int width, int height, int reps)
{
    const size_t n = 3 * (size_t)width * (size_t)height;
    saga_error error = { "" };
    bench_times times;
    saga_canvas c;
    size_t i;
    int r;

    memset(&times, 0, sizeof times);
    if (!saga_canvas_init(&c, n / 3, &error))
        exit(1);
    c.camera.width = width;
    c.camera.height = height;
    for (i = 0; i < n; i++) {
        c.image[i] = saga_rng_float(saga_rng_stream(1, 1), i);
        c.truth[i] = saga_rng_float(saga_rng_stream(1, 2), i);
    }
    for (r = 0; r < reps; r++) {
        const double at = bench_now_ms();

        saga_loss_picture(&c);
        bench_add(&times, bench_now_ms() - at);
    }
    printf("%dx%d squared error and gradient:", width, height);
    printf(" %.3f", bench_median(&times));
    printf(" (%.3f) ms\n", times.ms[0]);
    saga_canvas_free(&c);
}

int main(int argc, char **argv)
{
    const int reps = argc > 1 ? atoi(argv[1]) : 21;

#ifdef _OPENMP
    omp_set_num_threads(1);
#endif
    run(320, 180, reps);
    run(480, 270, reps);
    run(640, 360, reps);
    run(1352, 1014, reps > 7 ? 7 : reps);
    return 0;
}
