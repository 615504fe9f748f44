/* SPDX-License-Identifier: MIT
 *
 * The speed of the memory bank: one read of all slots, and the update of all
 * slots after a round. bench_mlp times the networks that belong to both.
 */
#include "bench_table.h"
#include "memory_bank.h"

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

#define READS 2000
#define WRITES 100
#define REPEATS 21
#define N_QUERIES 64

typedef struct {
    saga_bank m;
    uint8_t *block;
    int16_t query[N_QUERIES][SAGA_MAX_SLOT_WIDTH];
    int16_t write[SAGA_MAX_SLOTS][SAGA_MAX_SLOT_WIDTH];
    int32_t gate[SAGA_MAX_SLOTS];
    uint32_t sum;
} bench;

static uint32_t random_bits(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 33);
}

static int16_t random_q12(uint64_t *state)
{
    return (int16_t)((int32_t)(random_bits(state) % 8193) - 4096);
}

static void fill(bench *b, uint32_t n_slots, uint32_t width)
{
    uint64_t state = 1;

    b->m.n_slots = n_slots;
    b->m.width = width;
    b->m.hidden = 0;
    b->block = aligned_alloc(16, saga_bank_lay(&b->m, NULL));
    if (!b->block)
        exit(1);
    saga_bank_lay(&b->m, b->block);
    saga_bank_start(&b->m);
    /* The queries, gates and vectors are random. */
    for (uint32_t p = 0; p < N_QUERIES; p++)
        for (uint32_t d = 0; d < SAGA_MAX_SLOT_WIDTH; d++)
            b->query[p][d] = random_q12(&state);
    for (uint32_t p = 0; p < SAGA_MAX_SLOTS; p++) {
        b->gate[p] = (int32_t)(random_bits(&state) & 32767u);
        for (uint32_t d = 0; d < SAGA_MAX_SLOT_WIDTH; d++)
            b->write[p][d] = random_q12(&state);
    }
}

static void write_all(bench *b, int plain)
{
    for (uint32_t p = 0; p < b->m.n_slots; p++)
        saga_bank_update(&b->m, p, b->write[p], b->gate[p], plain);
}

static void report(const char *what, const bench *b, bench_times *t,
                   uint32_t n, uint32_t macs)
{
    char name[56];
    bench_row *r;

    snprintf(name, sizeof name, "bank %s, %u slots of %u", what,
             (unsigned)b->m.n_slots, (unsigned)b->m.width);
    r = bench_row_add(name, t);
    r->count = n;
    r->each = "each";
    r->kind = BENCH_MACS;
    r->work = (double)macs * n;
}

static void run_reads(bench *b)
{
    int16_t out[SAGA_MAX_SLOT_WIDTH];
    bench_times t = { { 0 }, 0 };

    for (uint32_t i = 0; i < REPEATS; i++) {
        const double start = bench_now_ms();

        for (uint32_t k = 0; k < READS; k++) {
            saga_bank_read(out, &b->m, b->query[k % N_QUERIES]);
            b->sum = b->sum * 31 + (uint16_t)out[0];
        }
        bench_add(&t, bench_now_ms() - start);
    }
    report("read", b, &t, READS,
           saga_bank_read_macs(b->m.n_slots, b->m.width));
}

static void run_writes(bench *b, int plain)
{
    bench_times t = { { 0 }, 0 };

    for (uint32_t i = 0; i < REPEATS; i++) {
        const double start = bench_now_ms();

        for (uint32_t k = 0; k < WRITES; k++)
            write_all(b, plain);
        bench_add(&t, bench_now_ms() - start);
        b->sum = b->sum * 31 + (uint16_t)b->m.slot[0];
    }
    report(plain ? "plain write" : "write", b, &t, WRITES,
           b->m.n_slots * saga_bank_update_macs(b->m.width, plain));
}

void bench_bank(void)
{
    static const struct {
        uint32_t n_slots, width;
    } sizes[] = { { 32, 32 }, { 64, 64 }, { 512, 64 } };
    static bench b;

    for (size_t i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        fill(&b, sizes[i].n_slots, sizes[i].width);
        run_reads(&b);
        run_writes(&b, 0);
        run_writes(&b, 1);
        free(b.block);
    }
}
