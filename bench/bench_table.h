/* SPDX-License-Identifier: MIT
 *
 * The table of everything that is timed. A row has the CPU time of the calling
 * thread, best and median of the repetitions, and compares it with this
 * machine's ceiling, a target time and an earlier result.
 */
#ifndef BENCH_TABLE_H
#define BENCH_TABLE_H

#include "bench_time.h"

/* The kinds of work. bench_ceilings measures the most that this machine can do
 * of each. */
typedef enum {
    BENCH_NOTHING,
    BENCH_CYCLES, /* dependent additions */
    BENCH_BYTES,  /* bytes copied */
    BENCH_MACS,   /* multiply-adds of int16 */
    BENCH_FLOPS,  /* float operations; a multiply-add counts as
                   * two */
    BENCH_N_KINDS
} bench_kind;

typedef struct bench_row {
    char name[56];
    double best, median; /* ms */
    double count;        /* number of units done in that time */
    const char *each;    /* the unit, such as "a pixel" */
    bench_kind kind;
    double work;   /* amount of work of the kind */
    double wanted; /* target time, ms; 0: none */
    char note[24];
} bench_row;

/* Adds a row with these times, which it sorts, and with count 1. The caller
 * sets the other members before it adds the next row. */
bench_row *bench_row_add(const char *name, bench_times *times);

/* Times repeated runs of `stage` and adds their row. */
bench_row *bench_measure(const char *name, void (*stage)(void *), void *data);

/* Returns memory that is aligned to 64 bytes and has been written once, so that
 * no page is missing; exits if there is none. */
void *bench_need(size_t nbytes);

/* The parts; each is in the file of its name. */
void bench_ceilings(void);
void bench_mlp(void);
void bench_coder(void);
void bench_stages(void);
void bench_net(void);
void bench_splat(void);
void bench_train(void);
void bench_gpu(void);

#endif
