/* SPDX-License-Identifier: MIT
 *
 * Elementary functions are compared with libm and with the properties that
 * fx_math.h promises. The bounds are derived and rounded up a little; each is
 * within a tenth of the measured error.
 */
#include "fx_math.h"
#include "testing.h"

#define PI 3.14159265358979323846

/* The bound in units of the last bit: parabola 1.02e-9 * 2^31 = 2.2; slope
 * rounded to Q39 and multiplied by 511: 511/2 * 2^-8 = 1.0; table 1/2; result
 * 1/2. The largest measured error is 3.85. */
#define EXP2_FRAC_BOUND 4.2

/* The bound in units of the last bit: result 1/2; chord 2^15 (ln 2 / 128)^2 / 8
 * = 0.1201. The largest measured error is 0.6185. */
#define EXP2_NEG_BOUND 0.6202

/* The bound in units of the last bit, for w = 1/8 and x = log2(1 + 2^-a): the
 * omitted third difference, w^3 max|x'''| 0.0080 = 0.76; the fourth, 3/128 w^4
 * max|x''''| = 0.25, which is largest elsewhere; result 1/2; roundings to Q24
 * 0.1. The largest measured error is 1.303. */
#define SOFTPLUS2_BOUND 1.31

/* The bound in units of the last bit, for w = 1/8: the omitted third
 * difference, w^3 max|f'''| 0.0080 2^15 = 0.064; the fourth, 3/128 w^4
 * max|f''''| = 0.024, which is largest elsewhere; result 1/2; roundings to Q24
 * 0.003. The largest measured error is 0.5612. */
#define SIGMOID_BOUND 0.57

/* The bound in units of the last bit: result 1/2; rounding of c0 1/8, of c1
 * 1/4, and of z^2 0.16, never all at once. The largest error over all phases is
 * 0.8123. */
#define SIN_BOUND 0.82

/* The bound in units of the last bit: result 1/2; chord 2^16 / (4 * 128 * 129)
 * = 0.993; dropped bits 2^16 2^-22 = 0.016. The largest measured error is
 * 1.504. */
#define RECIP16_BOUND 1.51

/* The bound of the relative error. Near x = 1 it is the chord's 1.55e-5
 * squared, 2.4e-10, and half a unit of Q31, 2.3e-10; near 2 the half unit alone
 * is 4.7e-10. The largest measured error is 4.8e-10. */
#define RECIP32_BOUND 5.2e-10

/* The bound of the relative error, at x = 2: 3/2 of the chord's 2.34e-5
 * squared, 8.2e-10; half a unit of Q31 3.3e-10; rounding of y^2 1.2e-10. The
 * largest measured error is 1.22e-9. */
#define RSQRT_BOUND 1.28e-9

static uint32_t random_bits(uint64_t *state)
{
    *state = *state * 6364136223846793005u + 1442695040888963407u;
    return (uint32_t)(*state >> 32);
}

/* Returns a number 1..2^32-1; all magnitudes are equally likely. */
static uint32_t random_positive(uint64_t *state)
{
    const uint32_t bits = random_bits(state);
    const uint32_t x = bits >> (random_bits(state) & 31u);

    return x ? x : 1;
}

static void expect_within(const char *what, double worst, double bound)
{
    print_message("%s: %.4g, bound %.4g\n", what, worst, bound);
    if (!(worst <= bound))
        fail_msg("%s: error %.6g above %.6g", what, worst, bound);
}

/* ---- exp2 ----------------------------------------------------------- */

TEST(exp2_frac_should_stay_within_bound_over_all_inputs)
{
    double worst = 0;

    for (uint32_t f = 0; f < 65536; f++) {
        const double want = exp2(f / 65536.0) * 1073741824;

        worst = fmax(worst, fabs(saga_exp2_frac_q16_q30(f) - want));
    }
    expect_within("exp2_frac (LSB)", worst, EXP2_FRAC_BOUND);
}

TEST(exp2_neg_should_stay_within_bound)
{
    double worst = 0;

    for (uint32_t x = 0; x < 18u << 20; x++) {
        const double want = exp2(15 - x / 1048576.0);

        worst = fmax(worst, fabs(saga_exp2_neg_q20_q15(x) - want));
    }
    expect_within("exp2_neg (LSB)", worst, EXP2_NEG_BOUND);
}

/* ---- softplus2 ------------------------------------------------------ */

static double softplus2(double x)
{
    return fmax(x, 0) + log1p(exp2(-fabs(x))) / log(2.0);
}

TEST(softplus2_should_stay_within_bound_over_all_inputs)
{
    double worst = 0;

    for (int32_t x = -(1 << 20); x <= 1 << 20; x++) {
        const double want = softplus2(x / 4096.0) * 1048576;

        worst = fmax(worst, fabs(saga_softplus2_q12_q20(x) - want));
    }
    expect_within("softplus2 (LSB)", worst, SOFTPLUS2_BOUND);
}

/* ---- sigmoid -------------------------------------------------------- */

TEST(sigmoid_should_stay_within_bound_over_all_inputs)
{
    double worst = 0;

    for (int32_t x = INT16_MIN; x <= INT16_MAX; x++) {
        const double want = 32768 / (1 + exp(-x / 2048.0));

        worst = fmax(worst, fabs(saga_sigmoid_q11_q15((int16_t)x) - want));
    }
    expect_within("sigmoid (LSB)", worst, SIGMOID_BOUND);
}

/* ---- sin ------------------------------------------------------------ */

TEST(sin_should_stay_within_bound_over_all_phases)
{
    double worst = 0;

    for (uint32_t p = 0; p < 65536; p++) {
        const double y = sin(p * (PI / 32768)) * 32768;
        const double want = fmax(-32767, fmin(32767, y));

        worst = fmax(worst, fabs(saga_sin_turn16_q15(p) - want));
    }
    expect_within("sin (LSB)", worst, SIN_BOUND);
}

TEST(sines_should_be_each_that_of_its_phase)
{
    enum { N = 37 };
    uint16_t phase[N];
    int16_t y[N];
    saga_cpu cpu;

    for (cpu = SAGA_CPU_PLAIN; cpu <= saga_cpu_best(); cpu++)
        for (uint32_t p = 0; p < 65536; p += N) {
            for (uint32_t i = 0; i < N; i++)
                phase[i] = (uint16_t)(p + i);
            saga_sin_turn16_each(y, phase, N, cpu);
            for (uint32_t i = 0; i < N; i++)
                assert_int_equal(y[i], saga_sin_turn16_q15(phase[i]));
        }
}

/* ---- reciprocals ---------------------------------------------------- */

static double recip16_error(uint32_t x)
{
    int shift;
    const uint32_t m = saga_recip16(x, &shift);

    assert_true(m >= 1u << 15 && m <= 1u << 16);
    assert_in_range(shift, 16, 47);
    return fabs(m - ldexp(1.0 / x, shift));
}

static double recip32_error(uint32_t x)
{
    int shift;
    const uint32_t m = saga_recip32(x, &shift);

    assert_true(m >= 1u << 30 && m <= 1u << 31);
    assert_in_range(shift, 31, 62);
    return fabs(ldexp(m, -shift) * x - 1);
}

static void worst_recip(uint32_t x, double *worst16, double *worst32)
{
    *worst16 = fmax(*worst16, recip16_error(x));
    *worst32 = fmax(*worst32, recip32_error(x));
}

TEST(recip_should_stay_within_bound)
{
    double worst16 = 0, worst32 = 0;
    uint64_t seed = 1;

    for (uint32_t i = 1; i < 1u << 17; i++) {
        worst_recip(i, &worst16, &worst32);
        worst_recip(0u - i, &worst16, &worst32);
        worst_recip((1u << 31) - i, &worst16, &worst32);
        worst_recip((1u << 31) + i, &worst16, &worst32);
    }
    for (uint32_t i = 0; i < 2000000; i++)
        worst_recip(random_positive(&seed), &worst16, &worst32);
    expect_within("recip16 (LSB)", worst16, RECIP16_BOUND);
    expect_within("recip32 (relative)", worst32, RECIP32_BOUND);
}

/* ---- rsqrt ---------------------------------------------------------- */

static double rsqrt_error(uint32_t mant, int32_t exp)
{
    const saga_float x = { mant, exp };
    const saga_float y = saga_rsqrt(x);
    const double root = sqrt(ldexp(mant, (exp & 1) - 30));
    const int32_t half = (exp - (exp & 1)) / 2;

    assert_true(y.mant_q30 >> 30 == 1);
    return fabs(ldexp(y.mant_q30, y.exp + half - 30) * root - 1);
}

TEST(rsqrt_should_stay_within_bound)
{
    double worst = 0;
    uint64_t seed = 1;

    for (uint32_t i = 0; i < 1u << 17; i++) {
        for (int32_t odd = 0; odd < 2; odd++) {
            worst = fmax(worst, rsqrt_error((1u << 30) + i, odd));
            worst = fmax(worst, rsqrt_error((1u << 31) - 1 - i, odd));
        }
    }
    for (uint32_t i = 0; i < 2000000; i++) {
        const uint32_t mant = 1u << 30 | random_bits(&seed) >> 2;
        const int32_t exp = (int32_t)(random_bits(&seed) >> 1) - (1 << 30);

        worst = fmax(worst, rsqrt_error(mant, exp));
    }
    expect_within("rsqrt (relative)", worst, RSQRT_BOUND);
}

/* ---- the norm ------------------------------------------------------- */

/* Adds the four bytes of x to a hash (FNV-1a), the lowest byte first. */
static uint32_t hash(uint32_t h, uint32_t x)
{
    for (int i = 0; i < 4; i++, x >>= 8)
        h = (h ^ (x & 255u)) * 16777619u;
    return h;
}

static uint32_t hash_exp2(void)
{
    uint32_t h = 2166136261u;

    for (uint32_t i = 0; i < 65536; i++)
        h = hash(h, saga_exp2_frac_q16_q30(i));
    for (uint32_t i = 0; i <= 16u << 20; i += 63)
        h = hash(h, saga_exp2_neg_q20_q15(i));
    return h;
}

static uint32_t hash_softplus2_sin(void)
{
    uint32_t h = 2166136261u;

    for (int32_t i = -(1 << 20); i <= 1 << 20; i++)
        h = hash(h, (uint32_t)saga_softplus2_q12_q20(i));
    for (int32_t i = 0; i < 65536; i++)
        h = hash(h, (uint32_t)(int32_t)saga_sin_turn16_q15((uint32_t)i));
    return h;
}

static uint32_t hash_sigmoid(void)
{
    uint32_t h = 2166136261u;

    for (int32_t i = INT16_MIN; i <= INT16_MAX; i++)
        h = hash(h, (uint32_t)saga_sigmoid_q11_q15((int16_t)i));
    return h;
}

static uint32_t hash_recip(void)
{
    uint32_t h = 2166136261u;
    uint64_t seed = 1;

    for (uint32_t i = 0; i < 200000; i++) {
        const uint32_t x = i < 100000 ? i + 1 : random_positive(&seed);
        int shift;

        h = hash(h, saga_recip16(x, &shift));
        h = hash(h, (uint32_t)shift);
        h = hash(h, saga_recip32(x, &shift));
        h = hash(h, (uint32_t)shift);
    }
    return h;
}

static uint32_t hash_rsqrt(void)
{
    uint32_t h = 2166136261u;
    uint64_t seed = 1;

    for (uint32_t i = 0; i < 200000; i++) {
        const saga_float x = { 1u << 30 | random_bits(&seed) >> 2,
                               (int32_t)i - 100000 };
        const saga_float y = saga_rsqrt(x);

        h = hash(h, y.mant_q30);
        h = hash(h, (uint32_t)y.exp);
    }
    return h;
}

/* The functions are part of the format, so that no bit may change. The hashes
 * are those of a second implementation, in Python with 50-digit tables, which
 * was written from docs/arithmetic.md. */
TEST(every_function_should_keep_its_bits)
{
    assert_int_equal(hash_exp2(), 0x3f19aa13u);
    assert_int_equal(hash_softplus2_sin(), 0xaf5f895bu);
    assert_int_equal(hash_sigmoid(), 0xf1a1a0c3u);
    assert_int_equal(hash_recip(), 0x112d1750u);
    assert_int_equal(hash_rsqrt(), 0x4970b6a7u);
}

/* Ends of the arguments, which the hashes leave out. */
TEST(values_at_the_ends_should_be_exact)
{
    int shift;

    assert_int_equal(saga_exp2_neg_q20_q15((16u << 20) - 1), 1);
    assert_int_equal(saga_exp2_neg_q20_q15(UINT32_MAX), 0);
    assert_int_equal(saga_softplus2_q12_q20((1 << 20) + 1), 1 << 28);
    assert_int_equal(saga_softplus2_q12_q20(INT32_MAX), 1 << 28);
    assert_int_equal(saga_softplus2_q12_q20(-(1 << 20) - 1), 0);
    assert_int_equal(saga_softplus2_q12_q20(INT32_MIN), 0);
    assert_int_equal(saga_sin_turn16_q15(0u - 16384u), -32767);
    assert_int_equal(saga_recip16(UINT32_MAX, &shift), 1u << 15);
    assert_int_equal(shift, 47);
    assert_int_equal(saga_recip32(UINT32_MAX, &shift), 1u << 30);
    assert_int_equal(shift, 62);
    for (int n = 0; n < 32; n++) {
        assert_int_equal(saga_recip16(1u << n, &shift), 1u << 16);
        assert_int_equal(saga_recip32(1u << n, &shift), 1u << 31);
        assert_int_equal(shift, 31 + n);
    }
}
