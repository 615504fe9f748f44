/* SPDX-License-Identifier: MIT
 *
 * lanes.h with AVX2, which has four lanes.
 */
#ifndef SAGA_LANES_AVX2_H
#define SAGA_LANES_AVX2_H

#include "cpu.h"

#ifdef SAGA_MAY_AVX2

#define AVX2 __attribute__((target("avx2")))
#define INLINE static inline __attribute__((always_inline)) AVX2
#define LANES 4

#include "lanes.h"

#define SIGN ((uint64_t)1 << 63)
#define BYTES(...)               \
    {                            \
        __VA_ARGS__, __VA_ARGS__ \
    }

typedef uint8_t u8s __attribute__((vector_size(32)));
typedef char i8x32 __attribute__((vector_size(32)));
typedef long long i64x4 __attribute__((vector_size(32)));

INLINE i64s mul(i64s a, i64s b)
{
    return (i64s)__builtin_ia32_pmuldq256((i32s)a, (i32s)b);
}

INLINE u64s mul_u(u64s a, u64s b)
{
    return (u64s)__builtin_ia32_pmuludq256((i32s)a, (i32s)b);
}

INLINE u64s shl(u64s x, u64s n)
{
    return (u64s)__builtin_ia32_psllv4di((i64x4)x, (i64x4)n);
}

INLINE u64s shr(u64s x, u64s n)
{
    return (u64s)__builtin_ia32_psrlv4di((i64x4)x, (i64x4)n);
}

/* Returns table[i] for each byte i in 0..15. Both halves of `table` are equal.
 */
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
#if defined __clang__ && __clang_major__ >= 15
    return __builtin_elementwise_sub_sat(a, b);
#else
    return (u8s)__builtin_ia32_psubusb256((i8x32)a, (i8x32)b);
#endif
}

INLINE i64s negative(i64s x)
{
    return x < 0;
}

INLINE i64s select(i64s mask, i64s a, i64s b)
{
    return (a & mask) | (b & ~mask);
}

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

/* AVX2 has no arithmetic shift of 64 bits. Therefore x + 2^63 is shifted, which
 * is not negative. */
INLINE i64s round_off(i64s x, int n)
{
    const uint64_t half = (uint64_t)1 << (n - 1);

    return (i64s)(((u64s)x + (SIGN + half)) >> n) - (int64_t)(SIGN >> n);
}

INLINE i64s round_low(i64s x, int n)
{
    return shift_down(x + all((int64_t)1 << (n - 1)), n);
}

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

INLINE i64s round_low_each(i64s x, const rounding *r)
{
    return (i64s)shr((u64s)x + r->half, r->n);
}

/* Returns, for each byte of x, 200 plus its number of bits, minus the byte of
 * `less` at the same place; 0 for bytes that are 0. */
INLINE u8s n_bits_bytes(i64s x, u8s less)
{
    const u8s low_half = BYTES(0, 201, 202, 202, 203, 203, 203, 203, 204, 204,
                               204, 204, 204, 204, 204, 204);
    const u8s high_half = BYTES(0, 205, 206, 206, 207, 207, 207, 207, 208, 208,
                                208, 208, 208, 208, 208, 208);
    const i64s fours = all(0x0f0f0f0f0f0f0f0f);

    return sub_u8(max_u8(nibbles(low_half, (u8s)(x & fours)),
                         nibbles(high_half, (u8s)(shift_down(x, 4) & fours))),
                  less);
}

/* Each byte gets the number of bits that x would have if it were the highest
 * byte other than 0: its own number of bits, from two table lookups, plus 8 for
 * each byte below it. The largest of these numbers is the result. All are
 * increased by a constant, so that bytes of 0 stay below all others. */
INLINE i64s n_bits(i64s x)
{
    const u8s less = BYTES(200, 192, 184, 176, 168, 160, 152, 144, 200, 192,
                           184, 176, 168, 160, 152, 144);
    u8s n = n_bits_bytes(x, less);

    n = max_u8(n, (u8s)shift_down((i64s)n, 32));
    n = max_u8(n, (u8s)shift_down((i64s)n, 16));
    n = max_u8(n, (u8s)shift_down((i64s)n, 8));
    return (i64s)n & 0xff;
}

INLINE i64s n_bits_halves(i64s x)
{
    const u8s less = BYTES(200, 192, 184, 176, 200, 192, 184, 176, 200, 192,
                           184, 176, 200, 192, 184, 176);
    u8s n = n_bits_bytes(x, less);

    n = max_u8(n, (u8s)((u32s)n >> 16));
    n = max_u8(n, (u8s)((u32s)n >> 8));
    return (i64s)n & 0xff000000ff;
}

INLINE i64s n_bits_nibble(i64s x)
{
    const u8s bits = BYTES(0, 1, 2, 2, 3, 3, 3, 3, 4, 4, 4, 4, 4, 4, 4, 4);

    return (i64s)nibbles(bits, (u8s)x);
}

INLINE i64s load_each(const uint8_t *p, size_t step)
{
    return (i64s){ load64(p), load64(p + step), load64(p + 2 * step),
                   load64(p + 3 * step) };
}

INLINE i64s entries(const void *table, i64s i)
{
    const uint8_t *const t = table;

    return (i64s){ load64(t + 4 * i[0]), load64(t + 4 * i[1]),
                   load64(t + 4 * i[2]), load64(t + 4 * i[3]) };
}

INLINE i64s entries16(const uint16_t *t, i64s i)
{
    return (i64s){ t[i[0]], t[i[1]], t[i[2]], t[i[3]] };
}

#endif
#endif
