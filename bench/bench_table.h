/* SPDX-License-Identifier: MIT
 *
 * One table of everything that is timed: CPU time of the calling thread, best
 * and median of repetitions, beside what this machine can do at most, what is
 * wanted, and an earlier result.
 */
#ifndef BENCH_TABLE_H
#define BENCH_TABLE_H

#include "bench_time.h"

/* A kind of work that has a ceiling, measured by bench_ceilings. */
typedef enum {
    BENCH_NOTHING,
    BENCH_CYCLES,                /* additions one after the other */
    BENCH_BYTES,                 /* copied */
    BENCH_MACS,                  /* int16 times int16 */
    BENCH_FLOPS,                 /* float: two a multiply-add */
    BENCH_N_KINDS
} bench_kind;

typedef struct bench_row {
    char name[56];
    double best, median;         /* ms */
    double count;                /* number of things done in that time */
    const char *each;            /* of which this is one */
    bench_kind kind;
    double work;                 /* of the kind, in all of it */
    double wanted;               /* ms, or 0 */
    char note[24];
} bench_row;

/* A new row of these times, which are sorted; count is 1. The caller fills in
 * the rest, until the next row. */
bench_row *bench_row_add(const char *name, bench_times *times);

/* The same, of `stage` run some times. */
bench_row *bench_measure(const char *name, void (*stage)(void *), void *data);

/* Memory of that many bytes, aligned to 64 and touched; exits without. */
void *bench_need(size_t nbytes);

/* The parts, each in a file of its own. */
void bench_ceilings(void);
void bench_mlp(void);
void bench_coder(void);
void bench_bank(void);
void bench_decode(void);
void bench_stages(void);
void bench_net(void);
void bench_splat(void);
void bench_train(void);

#endif
