/* SPDX-License-Identifier: MIT
 *
 * The static distributions. Every row must be a distribution, and coding with
 * it must take hardly more than the entropy; code lengths are computed in
 * double, without a coder. The checksums that docs/arithmetic.md gives for the
 * tables are compared, too. SAGA_ROOT is the repository's folder, by default
 * ".".
 */
#include "fx_math.h"
#include "prob.h"
#include "prob_tables.h"
#include "saga.h"
#include "sqrt_up.h"
#include "testing.h"

/* The bound of the bits per symbol above the entropy. Frequencies of 15 bits
 * cost at most 0.0009, at the widest scale, where 60 symbols have a frequency
 * of 1 because there is no smaller one. */
#define OVERHEAD_BOUND 0.001

/* The bound if sigma is between two rows, half an index from each. With d = ln
 * 2 / 14 and sigma >> 1 the divergence is d^2 nats = 0.0035 bits, and escapes
 * cost up to 0.001 more. The largest measured value is 0.0046. */
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

/* Returns the frequency of symbol 0, of each of +-m, or of the escape at m = M
 * + 1. */
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

/* Returns the probability of the residual m, without that of -m. */
static double mass(int m, double sigma)
{
    const double unit = 1 / (sigma * sqrt(2.0));

    if (m == 0)
        return erf(0.5 * unit);
    return 0.5 * (erfc((m - 0.5) * unit) - erfc((m + 0.5) * unit));
}

/* Returns the number of bits of the Exp-Golomb code of |q| - M - 1 and of the
 * sign. */
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

/* Returns the expected bits above the entropy if a normal variable with
 * deviation sigma is coded with row r. Values beyond 12 sigma are
 * negligible. */
static double overhead(row r, double sigma)
{
    double sum = 0;

    for (int m = 0; m < 12 * sigma + 3; m++) {
        const double p = mass(m, sigma);

        if (p > 0)
            sum += (m ? 2 : 1) * p * (symbol_bits(r, m) + log2(p));
    }
    return sum;
}

TEST(scale_rows_should_fill_the_table)
{
    assert_int_equal(saga_prob_offset[0], 0);
    assert_int_equal(saga_prob_offset[SAGA_N_SCALES] * sizeof(uint16_t),
                     sizeof saga_prob_start);
    for (int i = 0; i < SAGA_N_SCALES; i++)
        assert_in_range(get_row(i).max, 1, 255);
    assert_true(sizeof saga_prob_start + sizeof saga_prob_offset <=
                TABLE_NBYTES_MAX);
}

TEST(scale_rows_should_be_distributions)
{
    for (int i = 0; i < SAGA_N_SCALES; i++) {
        const row r = get_row(i);

        assert_int_equal(r.start[0], 0);
        for (int m = 1; m <= r.max; m++) {
            assert_true(r.start[m + 1] > r.start[m]);
            assert_int_equal((r.start[m + 1] - r.start[m]) % 2, 0);
            assert_true(frequency(r, m) <= frequency(r, m - 1));
        }
        assert_true(frequency(r, 0) >= 1);
        assert_true(frequency(r, r.max + 1) >= 1);
    }
}

/* The escape must have a probability of at most 2^-13, which is 4 of 32768. */
TEST(scales_should_leave_little_to_escape)
{
    for (int i = 0; i < SAGA_N_SCALES; i++) {
        const row r = get_row(i);
        const double tail = erfc((r.max + 0.5) / (scale_sigma(i) * sqrt(2.0)));

        assert_true(tail <= 1.0 / 8192);
        assert_in_range(frequency(r, r.max + 1), 1, 4);
    }
}

TEST(scales_should_cost_little_above_the_entropy)
{
    double worst = 0;

    for (int i = 0; i < SAGA_N_SCALES; i++)
        worst = fmax(worst, overhead(get_row(i), scale_sigma(i)));
    print_message("overhead %.6f bits, bound %.6f\n", worst, OVERHEAD_BOUND);
    assert_true(worst <= OVERHEAD_BOUND);
}

TEST(scales_should_be_dense_enough)
{
    const double half_step = exp2(0.5 / SAGA_SCALE_PER_OCTAVE);
    double worst = 0;

    for (int i = 0; i < SAGA_N_SCALES; i++) {
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

/* The frequencies must be right within one unit, and exact if n < 16. */
TEST(binomial_rows_should_be_binomial)
{
    assert_int_equal(sizeof saga_prob_binomial, 136 * sizeof(uint16_t));
    for (int n = 1; n <= 16; n++) {
        for (int k = 0; k <= n; k++) {
            const double want = choose(n, k) * 32768 / exp2(n);
            const int f = binomial_frequency(n, k);

            assert_true(f >= 1);
            assert_int_equal(f, binomial_frequency(n, n - k));
            assert_true(fabs(f - want) <= (n < 16 ? 0 : 1));
        }
    }
}

/* --- The page ------------------------------------------------------------ */

static char page[1 << 17];

static void read_page(void)
{
    const char *const root = getenv("SAGA_ROOT");
    char path[1024];
    FILE *f;
    size_t n;

    snprintf(path, sizeof path, "%s/docs/arithmetic.md", root ? root : ".");
    f = fopen(path, "r");
    if (!f)
        fail_msg("%s: cannot be read", path);
    n = fread(page, 1, sizeof page - 1, f);
    assert_true(n < sizeof page - 1);
    page[n] = '\0';
    fclose(f);
}

static uint32_t crc_on(uint32_t crc, uint32_t x)
{
    const uint8_t b[4] = { (uint8_t)x, (uint8_t)(x >> 8), (uint8_t)(x >> 16),
                           (uint8_t)(x >> 24) };

    return saga_crc32c(crc, b, 4);
}

/* Checks that the page has a checksum in the line that begins with `line`,
 * before the text `end`. */
static void check_page(const char *line, const char *end, uint32_t crc)
{
    char digits[9];
    const char *const at = strstr(page, line);
    const char *found;

    snprintf(digits, sizeof digits, "%08x", crc);
    if (!at)
        fail_msg("arithmetic.md has no '%s'", line);
    found = strstr(at, digits);
    if (!found || found > strstr(at, end))
        fail_msg("arithmetic.md, '%s': not %s", line, digits);
}

#define CHECK_TABLE(line, end, table)                         \
    do {                                                      \
        uint32_t crc = 0;                                     \
        size_t k;                                             \
        for (k = 0; k < sizeof(table) / sizeof *(table); k++) \
            crc = crc_on(crc, (uint32_t)(table)[k]);          \
        check_page(line, end, crc);                           \
    } while (0)

TEST(page_should_have_the_checksum_of_every_table)
{
    read_page();
    CHECK_TABLE("\n| exp2 |", "\n| soft", saga_exp2_q30);
    CHECK_TABLE("\n| soft |", "\n| sigm", saga_softplus2_q24);
    CHECK_TABLE("\n| sigm |", "\n| inv", saga_sigmoid_q24);
    CHECK_TABLE("\n| inv |", "\n| root", saga_recip_q23);
    CHECK_TABLE("\n| root |", "\n\n", saga_rsqrt_q23);
    CHECK_TABLE("of the 2,488 starts", "They", saga_prob_start);
    CHECK_TABLE("of the 136 starts", "\n\n", saga_prob_binomial);
    CHECK_TABLE("    up[i] =", "\n", saga_sqrt_up_q12);
}
