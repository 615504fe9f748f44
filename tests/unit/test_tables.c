/* SPDX-License-Identifier: MIT
 *
 * The static distributions: every row is one, and coding with it costs hardly
 * more than the entropy. Lengths are computed in double, without a coder.
 */
#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>

#include "prob.h"
#include "prob_tables.h"

#include <math.h>

/* Bits per symbol above the entropy. Frequencies of 15 bits cost little: the
 * most, 0.0009, is at the widest scale, where 60 symbols have f = 1 for want of
 * a smaller one. */
#define OVERHEAD_BOUND 0.001

/* The same if sigma lies half an index off: with d = ln 2 / 14 and
 * sigma >> 1 the divergence is d^2 nats = 0.0035 bits, and escapes cost up to
 * 0.001 more. Measured 0.0046. */
#define OVERHEAD_BETWEEN_BOUND 0.005

#define TABLE_NBYTES_MAX 8192

typedef struct {
    const uint16_t *start;
    int max;
} row;

static row get_row(int i)
{
    row r;

    r.start = saga_prob_start + saga_prob_offset[i];
    r.max = saga_prob_offset[i + 1] - saga_prob_offset[i] - 2;
    return r;
}

/* Of symbol 0, of each of +-m, and of escape at m = M + 1. */
static int frequency(row r, int m)
{
    if (m == 0)
        return r.start[1];
    if (m > r.max)
        return 32768 - r.start[r.max + 1];
    return (r.start[m + 1] - r.start[m]) / 2;
}

static double scale_sigma(int i)
{
    return exp2((i - SAGA_SCALE_UNIT) / (double)SAGA_SCALE_PER_OCTAVE);
}

/* P(q = m), one sign. */
static double mass(int m, double sigma)
{
    const double unit = 1 / (sigma * sqrt(2.0));

    if (m == 0)
        return erf(0.5 * unit);
    return 0.5 * (erfc((m - 0.5) * unit) - erfc((m + 0.5) * unit));
}

/* Bits of the Exp-Golomb code of |q| - M - 1 and of the sign. */
static double escape_bits(int beyond)
{
    const int high = (beyond >> SAGA_ESCAPE_ORDER) + 1;

    return 2 * floor(log2(high)) + 1 + SAGA_ESCAPE_ORDER + 1;
}

static double symbol_bits(row r, int m)
{
    const double bits = 15 - log2(frequency(r, m));

    return m > r.max ? bits + escape_bits(m - r.max - 1) : bits;
}

/* Expected length above the entropy of a normal variable of deviation sigma
 * coded with row r; beyond 12 sigma nothing is left. */
static double overhead(row r, double sigma)
{
    double sum = 0;
    int m;

    for (m = 0; m < 12 * sigma + 3; m++) {
        const double p = mass(m, sigma);

        if (p > 0)
            sum += (m ? 2 : 1) * p * (symbol_bits(r, m) + log2(p));
    }
    return sum;
}

static void scale_rows_should_fill_the_table(void **state)
{
    int i;

    (void)state;
    assert_int_equal(saga_prob_offset[0], 0);
    assert_int_equal(saga_prob_offset[SAGA_N_SCALES] * sizeof(uint16_t),
                     sizeof saga_prob_start);
    for (i = 0; i < SAGA_N_SCALES; i++)
        assert_in_range(get_row(i).max, 1, 255);
    assert_true(sizeof saga_prob_start + sizeof saga_prob_offset
                <= TABLE_NBYTES_MAX);
}

static void scale_rows_should_be_distributions(void **state)
{
    int i, m;

    (void)state;
    for (i = 0; i < SAGA_N_SCALES; i++) {
        const row r = get_row(i);

        assert_int_equal(r.start[0], 0);
        for (m = 1; m <= r.max; m++) {
            assert_true(r.start[m + 1] > r.start[m]);
            assert_int_equal((r.start[m + 1] - r.start[m]) % 2, 0);
            assert_true(frequency(r, m) <= frequency(r, m - 1));
        }
        assert_true(frequency(r, 0) >= 1);
        assert_true(frequency(r, r.max + 1) >= 1);
    }
}

/* 2^-13 is 4 of 32768. */
static void scales_should_leave_little_to_escape(void **state)
{
    int i;

    (void)state;
    for (i = 0; i < SAGA_N_SCALES; i++) {
        const row r = get_row(i);
        const double tail = erfc((r.max + 0.5) / (scale_sigma(i) * sqrt(2.0)));

        assert_true(tail <= 1.0 / 8192);
        assert_in_range(frequency(r, r.max + 1), 1, 4);
    }
}

static void scales_should_cost_little_above_the_entropy(void **state)
{
    double worst = 0;
    int i;

    (void)state;
    for (i = 0; i < SAGA_N_SCALES; i++)
        worst = fmax(worst, overhead(get_row(i), scale_sigma(i)));
    print_message("overhead %.6f bits, bound %.6f\n", worst, OVERHEAD_BOUND);
    assert_true(worst <= OVERHEAD_BOUND);
}

static void scales_should_be_dense_enough(void **state)
{
    const double half_step = exp2(0.5 / SAGA_SCALE_PER_OCTAVE);
    double worst = 0;
    int i;

    (void)state;
    for (i = 0; i < SAGA_N_SCALES; i++) {
        const double sigma = scale_sigma(i);

        worst = fmax(worst, overhead(get_row(i), sigma * half_step));
        worst = fmax(worst, overhead(get_row(i), sigma / half_step));
    }
    print_message("between scales %.6f bits, bound %.6f\n", worst,
                  OVERHEAD_BETWEEN_BOUND);
    assert_true(worst <= OVERHEAD_BETWEEN_BOUND);
}

static double choose(int n, int k)
{
    return floor(exp(lgamma(n + 1) - lgamma(k + 1) - lgamma(n - k + 1)) + 0.5);
}

static int binomial_frequency(int n, int k)
{
    const uint16_t *const start = saga_prob_binomial + n * (n - 1) / 2;
    const int from = k ? start[k - 1] : 0;

    return (k < n ? start[k] : 32768) - from;
}

/* Within one unit; a whole frequency below n = 16 exactly. */
static void binomial_rows_should_be_binomial(void **state)
{
    int n, k;

    (void)state;
    assert_int_equal(sizeof saga_prob_binomial, 136 * sizeof(uint16_t));
    for (n = 1; n <= 16; n++) {
        for (k = 0; k <= n; k++) {
            const double want = choose(n, k) * 32768 / exp2(n);
            const int f = binomial_frequency(n, k);

            assert_true(f >= 1);
            assert_int_equal(f, binomial_frequency(n, n - k));
            assert_true(fabs(f - want) <= (n < 16 ? 0 : 1));
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(scale_rows_should_fill_the_table),
        cmocka_unit_test(scale_rows_should_be_distributions),
        cmocka_unit_test(scales_should_leave_little_to_escape),
        cmocka_unit_test(scales_should_cost_little_above_the_entropy),
        cmocka_unit_test(scales_should_be_dense_enough),
        cmocka_unit_test(binomial_rows_should_be_binomial),
    };

    return cmocka_run_group_tests(tests, NULL, NULL);
}
