/* SPDX-License-Identifier: MIT
 *
 * The CPU time of the calling thread, and minimum and median of repetitions.
 */
#ifndef BENCH_TIME_H
#define BENCH_TIME_H

#include <stdlib.h>
#include <time.h>

enum { BENCH_MAX = 64 };

typedef struct bench_times {
    double ms[BENCH_MAX];
    int n;
} bench_times;

static inline double bench_now_ms(void)
{
    struct timespec t;

    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec * 1e3 + (double)t.tv_nsec * 1e-6;
}

static inline void bench_add(bench_times *b, double ms)
{
    if (b->n < BENCH_MAX)
        b->ms[b->n++] = ms;
}

static inline int bench_compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return x < y ? -1 : x > y;
}

/* Returns the median. Sorts the times, so that ms[0] is the minimum. */
static inline double bench_median(bench_times *b)
{
    qsort(b->ms, (size_t)b->n, sizeof *b->ms, bench_compare);
    return b->ms[b->n / 2];
}

#endif
