/* SPDX-License-Identifier: MIT
 *
 * Elementary functions in integers, by generated tables with interpolation or
 * Newton steps. Each comment states the domain, the formats and the maximum
 * error relative to the real function. tests/common/test_fx_math.c measures the
 * errors, over all inputs of 16-bit domains. docs/arithmetic.md has the
 * formulas.
 */
#ifndef SAGA_FX_MATH_H
#define SAGA_FX_MATH_H

#include "cpu.h"

#include <stdint.h>

/* A positive real m * 2^e, m in [2^30, 2^31): mant Q30, so value =
 * mant * 2^(exp - 30). */
typedef struct {
    uint32_t mant_q30;
    int32_t exp;
} saga_float;

/* Tables from fx_tables.h, also used by SIMD versions of these functions. */
extern const uint32_t saga_exp2_q30[129], saga_recip_q23[129];
extern const uint32_t saga_rsqrt_q23[129];
extern const int32_t saga_softplus2_q24[179], saga_sigmoid_q24[99];

/* 2^f, f_q16 in 0..65535 (f in [0, 1)): Q30, in [2^30, 2^31).
 * Exact at f = 0; strictly monotone; error <= 3.9 LSB. */
uint32_t saga_exp2_frac_q16_q30(uint32_t f_q16);

/* 2^-x, x_q20 in 0..2^32-1: Q15, 32768 at x = 0, 0 from x = 16 on.
 * Monotone; error <= 0.62 LSB. */
uint32_t saga_exp2_neg_q20_q15(uint32_t x_q20);

/* Replaces each of x[0..n), 0..2^31-1, by its 2^-x, in half the time per value.
 */
void saga_exp2_neg_each(int32_t *x, uint32_t n);

/* log2(1 + 2^x), |x_q12| <= 2^20 (clamped there): Q20, in [0, 2^28].
 * Monotone; f(x) - f(-x) = x exactly; error <= 1.31 LSB. */
int32_t saga_softplus2_q12_q20(int32_t x_q12);

/* 1 / (1 + e^-x), x_q11: Q15, 0..32768, 16384 at 0, 32768 from 11.1 on and 0
 * from -11.1 down. Monotone; f(x) + f(-x) = 1 exactly; error <= 0.57 LSB. */
int32_t saga_sigmoid_q11_q15(int16_t x_q11);

/* sin of a phase of 65536 units to the turn (bits above 16 are ignored): Q15,
 * +-32767 at the quarter turns, exactly odd and exactly symmetric about the
 * quarter turn. Error <= 0.82 LSB against the sine clamped to +-32767. */
int16_t saga_sin_turn16_q15(uint32_t phase);

/* Computes the sines of n phases, with the SIMD of the machine, `cpu`. The
 * arrays must not overlap. */
void saga_sin_turn16_each(int16_t *sine_q15, const uint16_t *phase, uint32_t n,
                          saga_cpu cpu);

/* The AVX2 version, in sine_avx2.c, if the rest is not compiled for AVX2. */
#if defined SAGA_MAY_AVX2 && !defined __AVX2__
#define SAGA_SINE_MAY_AVX2
void saga_sin_turn16_each__avx2(int16_t *sine_q15, const uint16_t *phase,
                                uint32_t n);
#endif

/* 1 / x for x >= 1, table only: mantissa m in [2^15, 2^16] and shift s in
 * 16..47 with 1/x ~ m * 2^-s. Exact at powers of two; m error <= 1.51 LSB.
 * Used if 16 bits suffice, as in kernel interpolation. */
uint32_t saga_recip16(uint32_t x, int *shift);

/* 1 / x for x >= 1, table and one Newton step: m in [2^30, 2^31] and s in
 * 31..62 with 1/x ~ m * 2^-s. Exact at powers of two; relative error
 * <= 2^-30. */
uint32_t saga_recip32(uint32_t x, int *shift);

/* 1 / sqrt(x) for x = mant * 2^(exp-30), |exp| < 2^30, table and one Newton
 * step: relative error <= 2^-29. Exact at powers of four. */
saga_float saga_rsqrt(saga_float x);

#endif
