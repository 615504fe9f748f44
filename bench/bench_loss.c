/* SPDX-License-Identifier: MIT
 *
 * L1 + SSIM with gradient: CPU milliseconds of one thread, median (min).
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
    const saga_loss_weights weights = saga_loss_paper();
    saga_error error = { "" };
    saga_picture_loss out;
    bench_times plain, l1;
    saga_canvas c;
    size_t i;
    int r;

    memset(&plain, 0, sizeof plain);
    l1 = plain;
    if (!saga_canvas_init(&c, n / 3, &error))
        exit(1);
    c.camera.width = width;
    c.camera.height = height;
    for (i = 0; i < n; i++) {
        c.image[i] = saga_rng_float(saga_rng_stream(1, 1), i);
        c.truth[i] = saga_rng_float(saga_rng_stream(1, 2), i);
    }
    for (r = 0; r < reps; r++) {
        const saga_loss_weights only_l1 = { 1, 0 };
        double at = bench_now_ms();

        saga_loss_picture(&out, &c, c.image, &weights, &error);
        bench_add(&plain, bench_now_ms() - at);
        at = bench_now_ms();
        saga_loss_picture(&out, &c, c.image, &only_l1, &error);
        bench_add(&l1, bench_now_ms() - at);
    }
    printf("%dx%d L1 + SSIM and gradient:", width, height);
    printf(" %.2f", bench_median(&plain));
    printf(" (%.2f) ms, L1 alone", plain.ms[0]);
    printf(" %.2f", bench_median(&l1));
    printf(" (%.2f)\n", l1.ms[0]);
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
