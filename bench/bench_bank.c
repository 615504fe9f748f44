/* SPDX-License-Identifier: MIT
 *
 * Speed of the memory bank: one read of all slots, and one round's write (the
 * updates alone; the networks around are bench_mlp's). Then a decoded segment,
 * and which share of it these make, from their own speed and number. CPU time
 * of this thread, min and median of the repetitions.
 */
#include "bench_time.h"
#include "gen_stream.h"
#include "head.h"
#include "memory_bank.h"
#include "plan.h"
#include "saga.h"

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
    uint32_t p, d;

    b->m.n_slots = n_slots;
    b->m.width = width;
    b->m.hidden = 0;
    b->block = aligned_alloc(16, saga_bank_lay(&b->m, NULL));
    if (!b->block)
        exit(1);
    saga_bank_lay(&b->m, b->block);
    saga_bank_start(&b->m);
    for (p = 0; p < N_QUERIES; p++)
        for (d = 0; d < SAGA_MAX_SLOT_WIDTH; d++)
            b->query[p][d] = random_q12(&state);
    for (p = 0; p < SAGA_MAX_SLOTS; p++) {
        b->gate[p] = (int32_t)(random_bits(&state) & 32767u);
        for (d = 0; d < SAGA_MAX_SLOT_WIDTH; d++)
            b->write[p][d] = random_q12(&state);
    }
}

static void write_all(bench *b, int plain)
{
    uint32_t p;

    for (p = 0; p < b->m.n_slots; p++)
        saga_bank_update(&b->m, p, b->write[p], b->gate[p], plain);
}

/* Returns the best time of one, in ms. */
static double report(const char *what, const bench *b, bench_times *t,
                     uint32_t n, uint32_t macs)
{
    const double median = bench_median(t);

    printf("%-11s L=%3u D=%2u: best %7.3f, median %7.3f us, %5.1f GMAC/s\n",
           what, (unsigned)b->m.n_slots, (unsigned)b->m.width,
           1e3 * t->ms[0] / n, 1e3 * median / n, 1e-6 * macs * n / t->ms[0]);
    return t->ms[0] / n;
}

static double run_reads(bench *b)
{
    int16_t out[SAGA_MAX_SLOT_WIDTH];
    bench_times t = { { 0 }, 0 };
    uint32_t i, k;

    for (i = 0; i < REPEATS; i++) {
        const double start = bench_now_ms();

        for (k = 0; k < READS; k++) {
            saga_bank_read(out, &b->m, b->query[k % N_QUERIES]);
            b->sum = b->sum * 31 + (uint16_t)out[0];
        }
        bench_add(&t, bench_now_ms() - start);
    }
    return report("read", b, &t, READS,
                  saga_bank_read_macs(b->m.n_slots, b->m.width));
}

static double run_writes(bench *b, int plain)
{
    bench_times t = { { 0 }, 0 };
    uint32_t i, k;

    for (i = 0; i < REPEATS; i++) {
        const double start = bench_now_ms();

        for (k = 0; k < WRITES; k++)
            write_all(b, plain);
        bench_add(&t, bench_now_ms() - start);
        b->sum = b->sum * 31 + (uint16_t)b->m.slot[0];
    }
    return report(plain ? "plain write" : "write", b, &t, WRITES,
                  b->m.n_slots * saga_bank_update_macs(b->m.width, plain));
}

/* --- A segment ----------------------------------------------------------- */

static void check(saga_status s)
{
    if (s) {
        fprintf(stderr, "bench_bank: %s\n", saga_status_text(s));
        exit(1);
    }
}

/* The best time of decoding segment 0, in ms. */
static double decode_ms(const uint8_t *bytes, size_t n)
{
    bench_times t = { { 0 }, 0 };
    saga_decoder *dec;
    saga_segment seg;
    saga_info info;
    void *work;
    int i;

    check(saga_probe(&info, bytes, n));
    check(saga_find(&seg, bytes, n, 0, 1));
    work = aligned_alloc(SAGA_WORK_ALIGN, info.work_nbytes);
    check(saga_open(&dec, work, info.work_nbytes, bytes, n));
    for (i = 0; i < 7; i++) {
        const double start = bench_now_ms();

        check(saga_decode(dec, &seg, bytes + seg.offset, seg.nbytes));
        bench_add(&t, bench_now_ms() - start);
    }
    (void)bench_median(&t);
    free(work);
    return t.ms[0];
}

/* All kinds read; one round for each group of a tier and each B blocks. */
static void run_segment(bench *b)
{
    const gen_options o = { .seed = 12, .level = 3, .n_coarse = 600,
                            .picture = 1, .tools_fixed = 1,
                            .tools = SAGA_TOOLS_PICTURE,
                            .bank = GEN_BANK_ORTHOGONAL,
                            .bank_slots = 64, .bank_width = 64,
                            .bank_blocks = 256, .bank_alone = 1 };
    double decode, reads, writes;
    saga_header h;
    saga_plan plan;
    uint8_t *bytes;
    gen_stream g;
    size_t n;

    gen_stream_make(&g, &o);
    gen_stream_encode(&g, &bytes, &n);
    check(saga_head_read(&h, bytes, n));
    check(saga_plan_make(&plan, &h, 0));
    decode = decode_ms(bytes, n);
    fill(b, 64, 64);
    reads = run_reads(b) * (h.max.coarse + 2.0 * h.max.fine);
    writes = run_writes(b, 0) * (saga_plan_rounds(&h.model, 0, h.max.coarse) +
                                 saga_plan_rounds(&h.model, 1, h.max.fine));
    printf("a segment of %u coarse, %u fine, %u primitives decodes in %.1f "
           "ms: reads %.1f %%, writes %.1f %%\n", (unsigned)h.max.coarse,
           (unsigned)h.max.fine, (unsigned)h.max.prim, decode,
           100 * reads / decode, 100 * writes / decode);
    free(b->block);
    free(bytes);
    gen_stream_free(&g);
}

int main(void)
{
    static const struct {
        uint32_t n_slots, width;
    } sizes[] = { { 32, 32 }, { 64, 32 }, { 128, 32 }, { 256, 32 },
                  { 512, 32 }, { 32, 64 }, { 64, 64 }, { 128, 64 },
                  { 256, 64 }, { 512, 64 } };
    static bench b;
    size_t i;

    for (i = 0; i < sizeof sizes / sizeof *sizes; i++) {
        fill(&b, sizes[i].n_slots, sizes[i].width);
        run_reads(&b);
        run_writes(&b, 0);
        run_writes(&b, 1);
        free(b.block);
    }
    run_segment(&b);
    printf("(sum %08lx)\n", (unsigned long)b.sum);
    return 0;
}
