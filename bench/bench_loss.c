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
    const saga_loss_weights weights = saga_loss_paper(R(0.2));
    real *const x = calloc(5 * n, sizeof *x);
    real *const y = x + n, *const d = y + n, *const blurs = d + n;
    saga_loss_work work = { 0 };
    saga_picture_loss out;
    bench_times plain, cached, l1;
    size_t i;
    int r;

    memset(&plain, 0, sizeof plain);
    cached = l1 = plain;
    for (i = 0; i < n; i++) {
        x[i] = saga_rng_float(saga_rng_stream(1, 1), i);
        y[i] = saga_rng_float(saga_rng_stream(1, 2), i);
    }
    saga_loss_blur_truth(blurs, &work, y, width, height);
    for (r = 0; r < reps; r++) {
        const saga_loss_weights only_l1 = { 1, 0 };
        double at = bench_now_ms();

        saga_loss_picture(&out, d, &work, x, y, NULL, width, height, &weights);
        bench_add(&plain, bench_now_ms() - at);
        at = bench_now_ms();
        saga_loss_picture(&out, d, &work, x, y, blurs, width, height,
                          &weights);
        bench_add(&cached, bench_now_ms() - at);
        at = bench_now_ms();
        saga_loss_picture(&out, d, &work, x, y, blurs, width, height,
                          &only_l1);
        bench_add(&l1, bench_now_ms() - at);
    }
    printf("%dx%d L1 + SSIM and gradient:", width, height);
    printf(" %.2f", bench_median(&plain));
    printf(" (%.2f) ms, truth cached", plain.ms[0]);
    printf(" %.2f", bench_median(&cached));
    printf(" (%.2f), L1 alone", cached.ms[0]);
    printf(" %.2f", bench_median(&l1));
    printf(" (%.2f)\n", l1.ms[0]);
    saga_loss_free(&work);
    free(x);
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
