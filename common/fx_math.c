/* SPDX-License-Identifier: MIT
 *
 * Elementary functions. docs/arithmetic.md defines them; the comments here
 * prove that all values fit their types. The errors are maxima measured by
 * tests/common/test_fx_math.c. */
#include "fx_math.h"

#include "fx.h"
#include "fx_tables.h"

#define INLINE static inline
#include "sine.h"

/* 2^f = 2^(i/128) (1 + e), e = 2^(r/65536) - 1 for r in 0..511, from
 *     e ~ r (c1 + c2 r),
 * the minimax parabola through 0, with a maximum error of 2^-29.9.
 *   c1 + c2 r in Q48: at most 2977038208 + 15783 * 511 + 2^8 < 2^32
 *   times r, in Q39:  at most 5830280 * 511 < 2^31.5
 *   table * e:        below 2^31 * 2^31.5
 * Result < 2^31: the largest, at f = 65535, is 2^31 - 22715.
 * Error: 3.9 LSB (of 2^30). A step of f is 11,357 LSB, hence monotone. */
uint32_t saga_exp2_frac_q16_q30(uint32_t f_q16)
{
    const uint32_t base = saga_exp2_q30[f_q16 >> 9 & 127u];
    const uint32_t r = f_q16 & 511u;
    const uint32_t slope = (2977038208u + 15783u * r + 256u) >> 9;
    const uint64_t product = (uint64_t)base * (slope * r);

    FX_ASSERT(f_q16 <= 65535u);
    return base + (uint32_t)((product + ((uint64_t)1 << 38)) >> 39);
}

/* 2^-x = 2^(k - 16) 2^f with k + f = 16 - x, k in 0..16, f in [0, 1): the
 * chord of 2^f over one of 128 cells, without a 64-bit product.
 *   (difference of entries) >> 6 <= 181213 < 2^18, lo < 2^13: product < 2^31
 *   v <= 2^31, rounding constant 2^(30-k) <= 2^30: sum < 2^32
 * Error: 0.62 LSB, of which 0.12 comes from the chord, which is never below the
 * function. Monotone, because each chord is, and none ends above the next
 * entry. */
uint32_t saga_exp2_neg_q20_q15(uint32_t x_q20)
{
    const uint32_t rest_q20 = (16u << 20) - x_q20;
    const uint32_t k = rest_q20 >> 20 & 31u;
    const uint32_t i = rest_q20 >> 13 & 127u;
    const uint32_t lo = rest_q20 & 8191u;
    const uint32_t chord = saga_exp2_q30[i + 1] - saga_exp2_q30[i];
    uint32_t v_q30;

    if (x_q20 >= 16u << 20)
        return 0;
    v_q30 = saga_exp2_q30[i] + ((chord >> 6) * lo >> 7);
    return (v_q30 + (1u << (30 - k))) >> (31 - k);
}

void saga_exp2_neg_each(int32_t *x, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        x[i] = (int32_t)saga_exp2_neg_q20_q15((uint32_t)x[i]);
}

/* Interpolates between s[1] and s[2], at t / 2^bits of the way, by the mean of
 * the two parabolas through three of the four entries (Bessel's formula),
 *     s1 + t (s2 - s1) - t (1 - t)/4 (s0 - s1 - s2 + s3).
 * For bits 8 or 9, t (1 - t) <= 1/4 is at most 2^14 here, so the entries need
 *   |s2 - s1| < 2^20: product < 2^29
 *   |bend| < 2^17: product < 2^31 */
static int32_t bessel(const int32_t *s, int32_t t, int bits)
{
    const int32_t bend = s[0] - s[1] - s[2] + s[3];
    const int32_t both = t * ((1 << bits) - t) >> (2 * bits - 16);
    const int32_t bow = fx_rshift(both * bend, 18 - bits);

    return s[1] + fx_rshift(t * (s[2] - s[1]) - bow, bits);
}

/* Returns log2(1 + 2^-a) for a >= 0, in cells of 1/8; |bend| <= 90739.
 * From a = 22 on it is below 1/2 LSB. Result in 0..2^20. Error: 1.3 LSB. */
static int32_t softplus2_tail_q20(int32_t a_q12)
{
    if (a_q12 >= 22 << 12)
        return 0;
    return fx_rshift(bessel(saga_softplus2_q24 + (a_q12 >> 9), a_q12 & 511, 9),
                     4);
}

/* f(x) = max(x, 0) + log2(1 + 2^-|x|), at most 2^20 * 2^8 = 2^28, since the
 * logarithm is 0 at the clamp. f(x) - f(-x) = x exactly. Monotone. */
int32_t saga_softplus2_q12_q20(int32_t x_q12)
{
    const int32_t x = fx_clamp(x_q12, -(1 << 20), 1 << 20);

    return x < 0 ? softplus2_tail_q20(-x) : x * 256 + softplus2_tail_q20(x);
}

/* Returns 1 / (1 + e^a) for a >= 0, in cells of 1/8; |bend| <= 50431.
 * From a = 12 on it is below 1/4 LSB. Result in 0..2^14. Error: 0.56 LSB. */
static int32_t sigmoid_tail_q15(int32_t a_q11)
{
    if (a_q11 >= 12 << 11)
        return 0;
    return fx_rshift(bessel(saga_sigmoid_q24 + (a_q11 >> 8), a_q11 & 255, 8),
                     9);
}

/* f(x) + f(-x) = 1 by construction. */
int32_t saga_sigmoid_q11_q15(int16_t x_q11)
{
    const int32_t x = x_q11;

    return x < 0 ? sigmoid_tail_q15(-x) : 32768 - sigmoid_tail_q15(x);
}

int16_t saga_sin_turn16_q15(uint32_t phase)
{
    return sin_turn16_q15(phase);
}

void saga_sin_turn16_each(int16_t *sine_q15, const uint16_t *phase, uint32_t n,
                          saga_cpu cpu)
{
#ifdef SAGA_SINE_MAY_AVX2
    if (cpu >= SAGA_CPU_AVX2) {
        saga_sin_turn16_each__avx2(sine_q15, phase, n);
        return;
    }
#endif
    (void)cpu;
    sin_turn16_each(sine_q15, phase, n);
}

/* 1 / (1 + t), t = x - 1 for x in [1, 2) as Q31 2^31..2^32-1: chord over one of
 * 128 cells, Q23 in 2^22..2^23.
 *   difference of entries <= 65028 < 2^16, lo < 2^15: product < 2^31
 * Relative error, with w = 1/128: at most +w^2 / (4 (1 + w)) from the chord,
 * +2^-22 from the 9 bits of x that lo drops, -3 2^-23 from rounding the entries
 * and truncating the result: -4e-7..+1.6e-5 in all.
 * Exact at x = 1. */
static uint32_t recip_chord_q23(uint32_t x_q31)
{
    const uint32_t i = x_q31 >> 24 & 127u;
    const uint32_t lo = x_q31 >> 9 & 32767u;
    const uint32_t chord = saga_recip_q23[i] - saga_recip_q23[i + 1];

    return saga_recip_q23[i] - (chord * lo >> 15);
}

/* 1/x = 2^n / (x 2^n), x 2^n in [2^31, 2^32): m 2^-16 = 2^31 / (x 2^n), so
 * s = 47 - n, in 16..47. Error: 1.5 LSB of m. Exact at powers of two. */
uint32_t saga_recip16(uint32_t x, int *shift)
{
    const int n = fx_clz32(x);

    *shift = 47 - n;
    return (recip_chord_q23(x << n) + 64u) >> 7;
}

/* The chord y0, then one Newton step y = y0 + y0 (1 - x y0): its relative
 * error is the square of the chord's, at most 2.4e-10 and below.
 *   x y0 in Q62: 2^62 (1 + 1.6e-5) < 2^63
 *   |1 - x y0| <= 1.6e-5: in Q46 < 2^31
 *   y0 times that: < 2^31 * 2^31
 * s = 62 - n, in 31..62. Error: 1.01 LSB of m, 2^-30.9 relative. */
uint32_t saga_recip32(uint32_t x, int *shift)
{
    const int n = fx_clz32(x);
    const uint32_t x_q31 = x << n;
    const uint32_t y0_q31 = recip_chord_q23(x_q31) << 8;
    const int64_t rest_q62 = (int64_t)(((uint64_t)1 << 62) -
                                       (uint64_t)x_q31 * y0_q31);
    const int32_t rest_q46 = (int32_t)(rest_q62 >> 16);

    *shift = 62 - n;
    return y0_q31 + (uint32_t)fx_rshift64((int64_t)y0_q31 * rest_q46, 46);
}

/* 1 / sqrt(x) for x in [1, 4), mant_q30 in [1, 2) and odd telling x = 2 mant:
 * chord over one of 64 cells per octave, Q23 in 2^22..2^23.
 *   difference of entries <= 64778 < 2^16, lo < 2^15: product < 2^31
 * Relative error, with w = 1/64: at most +3/32 w^2 from the chord, +2^-22 from
 * the bits that lo drops, -3 2^-23 from rounding the entries and truncating the
 * result: -4e-7..+2.34e-5 in all. */
static uint32_t rsqrt_chord_q23(uint32_t mant_q30, uint32_t odd)
{
    const uint32_t *const t = saga_rsqrt_q23 + 64u * odd +
                              (mant_q30 >> 24 & 63u);
    const uint32_t lo = mant_q30 >> 9 & 32767u;

    return t[0] - ((t[0] - t[1]) * lo >> 15);
}

/* y = y0 + y0 (1 - x y0^2)/2: relative error 3/2 of the square of the chord's.
 *   y0^2 in Q32 <= 2^32 (33 bits, at x = 1 only)
 *   x y0^2 in Q62: 2^62 (1 + 4.7e-5) < 2^63
 *   |1 - x y0^2| <= 4.7e-5: in Q45 < 2^31
 *   y0 times that: < 2^31 * 2^31
 * Result Q31 in 2^30..2^31. Relative error: 2^-29.6. */
static uint32_t rsqrt_newton_q31(uint32_t x_q30, uint32_t y0_q23)
{
    const uint64_t square_q32 = ((uint64_t)y0_q23 * y0_q23 + (1u << 13)) >> 14;
    const int64_t rest_q62 = (int64_t)(((uint64_t)1 << 62) -
                                       x_q30 * square_q32);
    const int32_t rest_q45 = (int32_t)(rest_q62 >> 17);
    const uint32_t y0_q31 = y0_q23 << 8;

    return y0_q31 + (uint32_t)fx_rshift64((int64_t)y0_q31 * rest_q45, 46);
}

/* x = X 2^(2h), X in [1, 4), so 1/sqrt(x) = X^(-1/2) 2^-h with the root in
 * (1/2, 1]: the exponent is -h - 1, and -h for X = 1 only. */
saga_float saga_rsqrt(saga_float x)
{
    const uint32_t odd = (uint32_t)x.exp & 1u;
    const int32_t h = (x.exp - (int32_t)odd) / 2;
    const uint32_t y_q31 = rsqrt_newton_q31(x.mant_q30 << odd,
                                            rsqrt_chord_q23(x.mant_q30, odd));
    const uint32_t one = y_q31 >> 31;
    saga_float y;

    FX_ASSERT(x.mant_q30 >> 30 == 1u);
    y.mant_q30 = y_q31 >> one;
    y.exp = (int32_t)one - 1 - h;
    return y;
}
