/* SPDX-License-Identifier: MIT
 *
 * common/fx_math.c in vectors. The formulas are the same; fx_math.c proves that
 * all values fit. lanes.h says what must be defined before this file.
 */
#ifndef SAGA_FX_LANES_H
#define SAGA_FX_LANES_H

#include "lanes.h"
#include "fx_math.h"
#include "sqrt_up.h"

#ifdef INLINE

/* A pair of mantissa and exponent in each lane, see saga_float. */
typedef struct {
    i64s mant, exp;
} pairs;

/* Returns saga_exp2_frac_q16_q30(64 f). All arguments in the decoder have at
 * most 10 bits of fraction. */
INLINE i64s exp2_frac_q10_q30(i64s f)
{
    const i64s base = lower(entries(saga_exp2_q30, shift_down(f & 1023, 3)));
    const i64s r = (f & 7) << 6;
    const i64s slope = shift_down(mul(r, all(15783)) + (2977038208 + 256), 9);
    const i64s product = (i64s)mul_u((u64s)base, mul_u((u64s)slope, (u64s)r));

    return base + shift_down(product + ((int64_t)1 << 38), 39);
}

/* Like the function of fx_math.c, for a in 0..22 * 2^12 - 1. */
INLINE i64s softplus2_tail_q20(i64s a)
{
    const i64s cell = shift_down(a, 9), t = a & 511;
    const i64s s01 = entries(saga_softplus2_q24, cell);
    const i64s s23 = entries(saga_softplus2_q24 + 2, cell);
    const i64s s0 = lower(s01), s1 = shift_down(s01, 32);
    const i64s s2 = lower(s23), s3 = shift_down(s23, 32);
    const i64s both = shift_down(mul(t, 512 - t), 2);
    const i64s bow = round_off(mul(both, s0 - s1 - s2 + s3), 9);

    return round_off(s1 + round_off(mul(t, s2 - s1) - bow, 9), 4);
}

/* Like the function of fx_math.c, but without clamping x, because a lane has
 * room for 256 x. */
INLINE i64s softplus2_q12_q20(i64s x)
{
    const i64s a = abs_small(x), end = all(22 << 12);
    const i64s tail = softplus2_tail_q20(min_small(a, end - 1)) &
                      negative(a - end);

    return (max_small(x, all(0)) << 8) + tail;
}

INLINE i64s recip_chord_q23(i64s x_q31)
{
    const i64s t = entries(saga_recip_q23, shift_down(x_q31, 24) & 127);
    const i64s chord = t - shift_down(t, 32);
    const i64s lo = shift_down(x_q31, 9) & 32767;

    return lower(t) - shift_down(mul(chord, lo), 15);
}

/* Returns the mantissa m of saga_recip16(x), from x_q31 = x 2^n in
 * [2^31, 2^32). */
INLINE i64s recip16_of(i64s x_q31)
{
    return shift_down(recip_chord_q23(x_q31) + 64, 7);
}

/* Returns -m, where m is the mantissa of saga_recip32(x), from x_q31 = x 2^n in
 * [2^31, 2^32). m may be 2^31, which is no signed number of 32 bits, but -m is.
 */
INLINE i64s minus_recip32_of(i64s x_q31)
{
    const i64s y0_q31 = recip_chord_q23(x_q31) << 8;
    const i64s rest_q62 = ((int64_t)1 << 62) -
                          (i64s)mul_u((u64s)x_q31, (u64s)y0_q31);
    const i64s rest_q46 = shift_down(rest_q62, 16); /* low */
    const i64s minus_y0 = 0 - y0_q31;

    return minus_y0 - round_off(0 - mul(minus_y0, rest_q46), 46);
}

/* Like the function of fx_math.c. y0^2 in Q32 is computed as 2^32 - d, so that
 * d fits 32 bits. */
INLINE i64s rsqrt_newton_q31(i64s x_q30, i64s y0_q23)
{
    const i64s square_q32 = round_low(mul(y0_q23, y0_q23), 14);
    const i64s d = ((int64_t)1 << 32) - square_q32;
    const i64s product = shift_up(x_q30, 32) -
                         (i64s)mul_u((u64s)x_q30, (u64s)d);
    const i64s rest_q62 = ((int64_t)1 << 62) - product;
    const i64s rest_q45 = shift_down(rest_q62, 17); /* low */
    const i64s y0_q31 = y0_q23 << 8;

    return y0_q31 + round_off(0 - mul(0 - y0_q31, rest_q45), 46);
}

/* |exp| < 2^30. */
INLINE pairs rsqrt_each(pairs x)
{
    const i64s odd = x.exp & 1;
    const i64s cell = (odd << 6) + (shift_down(x.mant, 24) & 63);
    const i64s t = entries(saga_rsqrt_q23, cell);
    const i64s lo = shift_down(x.mant, 9) & 32767;
    const i64s chord = t - shift_down(t, 32);
    const i64s y0_q23 = lower(t) - shift_down(mul(chord, lo), 15);
    const i64s x_q30 = x.mant + (x.mant & (0 - odd));
    const i64s y_q31 = rsqrt_newton_q31(x_q30, y0_q23);
    const i64s one = shift_down(y_q31, 31);
    const i64s h = shift_down(x.exp - odd + ((int64_t)1 << 32), 1) -
                   ((int64_t)1 << 31);
    pairs y;

    y.mant = y_q31 - (one << 30);
    y.exp = one - 1 - h;
    return y;
}

/* Returns sqrt_up_q20_q12 of each lane in 1..2^24; other lanes are undefined.
 */
INLINE i64s sqrt_up_each(i64s x_q20)
{
    const i64s is_large = negative((8 << 20) - x_q20);
    const i64s at = select(is_large, shift_down(x_q20 - 1, 17),
                           shift_down(x_q20 - 1, 15));
    const i64s up = entries16(saga_sqrt_up_q12, at & 255);

    return up + (up & is_large);
}

#endif
#endif
