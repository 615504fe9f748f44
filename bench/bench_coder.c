/* SPDX-License-Identifier: MIT
 *
 * The speed of the range decoder alone. It decodes residuals at three scales,
 * about 1.18, 2.26 and 4.22 bits a symbol, drawn from the scale's own
 * distribution, and then adaptive symbols. The excess of the coded bits over
 * the entropy is reported, too. Times are CPU times of this thread, minimum and
 * median of the repetitions.
 */
#include "bench_table.h"
#include "freed.h"
#include "gen_stream.h"
#include "prob.h"
#include "range_dec.h"
#include "range_enc.h"

#include <math.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

enum { N = 1 << 20, BLOCK = 64, REPEATS = 15 };

static const saga_at nowhere = { 0, 0, 0, 0, 0 };

/* Adds a row; its note is the excess over the entropy. */
static void report(const char *what, bench_times *t, size_t nbytes,
                   double ideal_bits)
{
    const double bits = 8 * (double)nbytes;
    bench_row *r;
    char name[56];

    snprintf(name, sizeof name, "%s, %.2f bits", what, bits / N);
    r = bench_row_add(name, t);
    r->count = N;
    r->each = "a symbol";
    r->wanted = what[0] == 'r' ? N / 50e3 : 0;
    snprintf(r->note, sizeof r->note, "+%.3f %%",
             100 * (bits / ideal_bits - 1));
}

static void check(int ok)
{
    if (!ok) {
        fprintf(stderr, "bench_coder: the decoder read something else\n");
        exit(1);
    }
}

/* --- Residuals ----------------------------------------------------------- */

/* Returns the q at cumulative frequency u and sets *p to its probability. An
 * escape becomes the last q of the table. */
static int32_t draw(saga_scale_row row, uint32_t u, double *p)
{
    uint32_t m = 0, half;

    while (m < row.max && u >= row.start[m + 1])
        m++;
    half = (uint32_t)(row.start[m] + row.start[m + 1]) >> 1;
    if (m == 0) {
        *p = row.start[1] / (double)SAGA_PROB_TOTAL;
        return 0;
    }
    *p = (u < half ? half - row.start[m] : row.start[m + 1] - half) /
         (double)SAGA_PROB_TOTAL;
    return u < half ? (int32_t)m : -(int32_t)m;
}

static void run_residuals(const char *what, uint32_t index)
{
    static int32_t want[N];
    const size_t cap = N;
    FREED uint8_t *const bytes = malloc(cap);
    bench_times t = { { 0 }, 0 };
    uint8_t scale[BLOCK];
    saga_range_enc e;
    double ideal = 0, p;
    uint64_t r = 1;
    size_t n;

    /* N residuals are drawn and coded. */
    saga_range_enc_init(&e, bytes, cap);
    for (int i = 0; i < N; i++) {
        want[i] = draw(saga_prob_scale(index),
                       (uint32_t)gen_range(&r, 0, SAGA_PROB_TOTAL - 1), &p);
        ideal -= log2(p);
        saga_range_enc_residual(&e, want[i], index);
    }
    n = saga_range_enc_finish(&e);
    /* Only decoding is timed; it must return the same residuals. */
    for (int i = 0; i < BLOCK; i++)
        scale[i] = (uint8_t)index;
    for (int k = 0; k < REPEATS; k++) {
        static int32_t q[N];
        const double start = bench_now_ms();
        saga_range_dec d;

        saga_range_dec_init(&d, bytes, n);
        for (int i = 0; i < N; i += BLOCK)
            d.coder.residual(&d.coder, nowhere, q + i, NULL, 1 << 16, scale,
                             BLOCK);
        bench_add(&t, bench_now_ms() - start);
        check(saga_range_dec_finish(&d));
        for (int i = 0; i < N; i++)
            check(q[i] == want[i]);
    }
    report(what, &t, n, ideal);
}

/* --- Adaptive symbols ---------------------------------------------------- */

/* Times symbols 0..n_sym-1, of which the first has the probability 1 - 1/one_in
 * and the others share the rest. The excess is relative to the entropy of this
 * source, which the adaptive model must learn. */
static void run_adaptive(const char *what, uint32_t n_sym, int one_in)
{
    static uint8_t want[N];
    const size_t cap = N;
    FREED uint8_t *const bytes = malloc(cap);
    const double rare = 1.0 / one_in;
    const double ideal = -N * ((1 - rare) * log2(1 - rare) +
                               rare * log2(rare / (n_sym - 1)));
    bench_times t = { { 0 }, 0 };
    saga_adaptive m;
    saga_range_enc e;
    uint64_t r = 1;
    size_t n;

    /* N symbols are coded: 0, or one of the others once in one_in. */
    saga_range_enc_init(&e, bytes, cap);
    saga_adaptive_init(&m, n_sym);
    for (int i = 0; i < N; i++) {
        const uint32_t sym = gen_range(&r, 1, one_in) > 1
                                 ? 0
                                 : (uint32_t)gen_range(&r, 1,
                                                       (int32_t)n_sym - 1);

        want[i] = (uint8_t)sym;
        saga_range_enc_interval(&e, saga_adaptive_start(&m, sym),
                                sym + 1 < n_sym ? m.start[sym]
                                                : SAGA_PROB_TOTAL);
        saga_adaptive_update(&m, n_sym, sym);
    }
    n = saga_range_enc_finish(&e);
    /* Only decoding is timed; it must return the same symbols. */
    for (int k = 0; k < REPEATS; k++) {
        static uint8_t got[N];
        const double start = bench_now_ms();
        saga_range_dec d;

        saga_adaptive_init(&m, n_sym);
        saga_range_dec_init(&d, bytes, n);
        for (int i = 0; i < N; i++)
            got[i] = (uint8_t)d.coder.adaptive(&d.coder, nowhere, &m, n_sym);
        bench_add(&t, bench_now_ms() - start);
        check(saga_range_dec_finish(&d));
        for (int i = 0; i < N; i++)
            check(got[i] == want[i]);
    }
    report(what, &t, n, ideal);
}

void bench_coder(void)
{
    run_residuals("residuals, scale 14", 14);
    run_residuals("residuals, scale 23", 23);
    run_residuals("residuals, scale 37", 37);
    run_adaptive("adaptive bits, 1 in 8", 2, 8);
    run_adaptive("adaptive, 17 symbols", 17, 2);
}
