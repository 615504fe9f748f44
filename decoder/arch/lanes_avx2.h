/* SPDX-License-Identifier: MIT
 *
 * Integers of 64 bits in vectors of four, in AVX2. What is "low" in a comment
 * is valid in the lower half of a lane only, which is all that mul() looks at;
 * the upper half is anything. Sums, differences and left shifts of low values
 * are low. A value is "small" where 32 bits hold it.
 *
 * Builtins and vector types rather than immintrin.h, which wants a C library.
 */
#ifndef SAGA_LANES_AVX2_H
#define SAGA_LANES_AVX2_H

#include "cpu.h"

#include <stddef.h>
#include <stdint.h>

#ifdef SAGA_MAY_AVX2

#define AVX2 __attribute__((target("avx2")))
#define INLINE static inline __attribute__((always_inline)) AVX2

enum { LANES = 4 };

#define BYTES(...) { __VA_ARGS__, __VA_ARGS__ }

typedef int64_t i64s __attribute__((vector_size(32)));
typedef uint64_t u64s __attribute__((vector_size(32)));
typedef int32_t i32s __attribute__((vector_size(32)));
typedef uint32_t u32s __attribute__((vector_size(32)));
typedef uint8_t u8s __attribute__((vector_size(32)));
typedef char i8x32 __attribute__((vector_size(32)));
typedef long long i64x4 __attribute__((vector_size(32)));

/* The product of the lower halves, signed. */
INLINE i64s mul(i64s a, i64s b)
{
    return (i64s)__builtin_ia32_pmuldq256((i32s)a, (i32s)b);
}

/* The same, unsigned. */
INLINE u64s mul_u(u64s a, u64s b)
{
    return (u64s)__builtin_ia32_pmuludq256((i32s)a, (i32s)b);
}

/* Shifts of each lane by its own n, 0..63. */
INLINE u64s shl(u64s x, u64s n)
{
    return (u64s)__builtin_ia32_psllv4di((i64x4)x, (i64x4)n);
}

INLINE u64s shr(u64s x, u64s n)
{
    return (u64s)__builtin_ia32_psrlv4di((i64x4)x, (i64x4)n);
}

/* table[i] for each byte i in 0..15; the table stands twice. */
INLINE u8s nibbles(u8s table, u8s i)
{
    return (u8s)__builtin_ia32_pshufb256((i8x32)table, (i8x32)i);
}

INLINE u8s max_u8(u8s a, u8s b)
{
#ifdef __clang__
    return __builtin_elementwise_max(a, b);
#else
    return (u8s)__builtin_ia32_pmaxub256((i8x32)a, (i8x32)b);
#endif
}

/* The difference, or 0. */
INLINE u8s sub_u8(u8s a, u8s b)
{
    return (u8s)__builtin_ia32_psubusb256((i8x32)a, (i8x32)b);
}

/* -1 where x < 0, else 0. */
INLINE i64s negative(i64s x)
{
    return x < 0;
}

/* Of small values; low where one of them is. */
INLINE i64s max_small(i64s a, i64s b)
{
#ifdef __clang__
    return (i64s)__builtin_elementwise_max((i32s)a, (i32s)b);
#else
    return (i64s)__builtin_ia32_pmaxsd256((i32s)a, (i32s)b);
#endif
}

INLINE i64s min_small(i64s a, i64s b)
{
#ifdef __clang__
    return (i64s)__builtin_elementwise_min((i32s)a, (i32s)b);
#else
    return (i64s)__builtin_ia32_pminsd256((i32s)a, (i32s)b);
#endif
}

#define SIGN ((uint64_t)1 << 63)

INLINE i64s all(int64_t x)
{
    const i64s zero = { 0 };

    return zero + x;
}

/* b where the mask is 0, a where it is -1. */
INLINE i64s select(i64s mask, i64s a, i64s b)
{
    return (a & mask) | (b & ~mask);
}

/* All differences are below 2^63. */
INLINE i64s clamp_each(i64s x, int64_t lo, int64_t hi)
{
    const i64s up = select(negative(x - lo), all(lo), x);

    return select(negative(hi - up), all(hi), up);
}

INLINE i64s clamp_small(i64s x, int32_t lo, int32_t hi)
{
    return min_small(max_small(x, all(lo)), all(hi));
}

INLINE i64s abs_each(i64s x)
{
    const i64s sign = negative(x);

    return (x ^ sign) - sign;
}

INLINE i64s abs_small(i64s x)
{
    return max_small(x, 0 - x);
}

INLINE i64s lower(i64s x)
{
    return x & 0xffffffff;
}

/* Zeros come in from the left. */
INLINE i64s shift_down(i64s x, int n)
{
    return (i64s)((u64s)x >> n);
}

INLINE i64s shift_up(i64s x, int n)
{
    return (i64s)((u64s)x << n);
}

/* A low value in all of its lane. */
INLINE i64s widen(i64s low)
{
    return (lower(low) ^ 0x80000000) - 0x80000000;
}

/* fx_rshift64, n in 1..62. There is no arithmetic shift of 64 bits, so x is
 * shifted as x + 2^63. */
INLINE i64s round_off(i64s x, int n)
{
    const uint64_t half = (uint64_t)1 << (n - 1);

    return (i64s)(((u64s)x + (SIGN + half)) >> n) - (int64_t)(SIGN >> n);
}

/* The same, low, for n in 1..32. All of the lane where x >= 0. */
INLINE i64s round_low(i64s x, int n)
{
    return shift_down(x + all((int64_t)1 << (n - 1)), n);
}

/* fx_rshift64 by n of each lane, 0..62. */
typedef struct {
    u64s n, half, sign;
} rounding;

INLINE rounding round_by(i64s n)
{
    rounding r;

    r.n = (u64s)n;
    r.half = shl((u64s)all(1), r.n) >> 1;
    r.sign = shr((u64s)all(0) + SIGN, r.n);
    return r;
}

INLINE i64s round_each(i64s x, const rounding *r)
{
    return (i64s)(shr((u64s)x + (r->half + SIGN), r->n) - r->sign);
}

/* The same, low, for n in 0..32. All of the lane where x >= 0. */
INLINE i64s round_low_each(i64s x, const rounding *r)
{
    return (i64s)shr((u64s)x + r->half, r->n);
}

/* a b for |a| < 2^47, |b| < 2^31 and a product below 2^63. */
INLINE i64s mul_wide(i64s a, i64s b)
{
    return shift_up(mul(shift_down(a, 16), b), 16) + mul(a & 0xffff, b);
}

/* Bits of each byte, 200 more, or 0; less what its place says. */
INLINE u8s n_bits_bytes(i64s x, u8s less)
{
    const u8s low_half = BYTES(0, 201, 202, 202, 203, 203, 203, 203,
                               204, 204, 204, 204, 204, 204, 204, 204);
    const u8s high_half = BYTES(0, 205, 206, 206, 207, 207, 207, 207,
                                208, 208, 208, 208, 208, 208, 208, 208);
    const i64s fours = all(0x0f0f0f0f0f0f0f0f);

    return sub_u8(max_u8(nibbles(low_half, (u8s)(x & fours)),
                         nibbles(high_half, (u8s)(shift_down(x, 4) & fours))),
                  less);
}

/* Bits of x: 0 for 0. A byte knows how many it has from its two halves, and
 * where it stands; the largest such number is the lane's. The tables hold 200
 * more, and less the more to the right a byte stands, so that a byte of 0 stays
 * below all others. */
INLINE i64s n_bits(i64s x)
{
    const u8s less = BYTES(200, 192, 184, 176, 168, 160, 152, 144,
                           200, 192, 184, 176, 168, 160, 152, 144);
    u8s n = n_bits_bytes(x, less);

    n = max_u8(n, (u8s)shift_down((i64s)n, 32));
    n = max_u8(n, (u8s)shift_down((i64s)n, 16));
    n = max_u8(n, (u8s)shift_down((i64s)n, 8));
    return (i64s)n & 0xff;
}

/* Bits of the lower and of the upper half of x, in their halves. */
INLINE i64s n_bits_halves(i64s x)
{
    const u8s less = BYTES(200, 192, 184, 176, 200, 192, 184, 176,
                           200, 192, 184, 176, 200, 192, 184, 176);
    u8s n = n_bits_bytes(x, less);

    n = max_u8(n, (u8s)((u32s)n >> 16));
    n = max_u8(n, (u8s)((u32s)n >> 8));
    return (i64s)n & 0xff000000ff;
}

/* --- Memory -------------------------------------------------------------- */

INLINE int64_t load64(const void *p)
{
    int64_t x;

    __builtin_memcpy(&x, p, sizeof x);
    return x;
}

/* Eight bytes at p, p + step, p + 2 step ... */
INLINE i64s load_each(const uint8_t *p, size_t step)
{
    return (i64s){ load64(p), load64(p + step), load64(p + 2 * step),
                   load64(p + 3 * step) };
}

/* Two neighbouring entries, table[i] in the lower half of a lane. */
INLINE i64s entries(const void *table, i64s i)
{
    const uint8_t *const t = table;

    return (i64s){ load64(t + 4 * i[0]), load64(t + 4 * i[1]),
                   load64(t + 4 * i[2]), load64(t + 4 * i[3]) };
}

#endif
#endif
