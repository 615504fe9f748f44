/* SPDX-License-Identifier: MIT
 *
 * Integers of 64 bits in vectors of LANES. What is "low" in a comment is valid
 * in the lower half of a lane only, which is all that mul() looks at; the upper
 * half is anything. Sums, differences and left shifts of low values are low. A
 * value is "small" where 32 bits hold it.
 *
 * A file of a machine defines INLINE, how its functions are inlined, and LANES,
 * includes this and then defines what is only declared here. Builtins and
 * vector types rather than immintrin.h, which wants a C library.
 */
#ifndef SAGA_LANES_H
#define SAGA_LANES_H

#include <stddef.h>
#include <stdint.h>

#ifdef INLINE

#define LANES_NBYTES (8 * LANES)

typedef int64_t i64s __attribute__((vector_size(LANES_NBYTES)));
typedef uint64_t u64s __attribute__((vector_size(LANES_NBYTES)));
typedef int32_t i32s __attribute__((vector_size(LANES_NBYTES)));
typedef uint32_t u32s __attribute__((vector_size(LANES_NBYTES)));

/* --- What machines have differently -------------------------------------- */

/* The product of the lower halves, signed; and unsigned. */
INLINE i64s mul(i64s a, i64s b);
INLINE u64s mul_u(u64s a, u64s b);

/* Shifts of each lane by its own n, 0..63. */
INLINE u64s shl(u64s x, u64s n);
INLINE u64s shr(u64s x, u64s n);

/* Small values only; a lane is low where one of them is. */
INLINE i64s max_small(i64s a, i64s b);
INLINE i64s min_small(i64s a, i64s b);

/* -1 where x < 0, else 0. */
INLINE i64s negative(i64s x);

/* b where the mask is 0, a where it is -1. */
INLINE i64s select(i64s mask, i64s a, i64s b);

/* fx_rshift64, n in 1..62. */
INLINE i64s round_off(i64s x, int n);

/* The same, low, for n in 1..32. All of the lane where x >= 0. */
INLINE i64s round_low(i64s x, int n);

/* A machine has a struct `rounding` for fx_rshift64 by n of each lane, 0..62,
 * which round_by(n) makes; the second is low, for n in 0..32, and all of the
 * lane where x >= 0.
 *     rounding round_by(i64s n)
 *     i64s round_each(i64s x, const rounding *r)
 *     i64s round_low_each(i64s x, const rounding *r) */

/* Bits of x: 0 for 0. */
INLINE i64s n_bits(i64s x);

/* Bits of the lower and of the upper half of x, in their halves. */
INLINE i64s n_bits_halves(i64s x);

/* Bits of x in 0..15. */
INLINE i64s n_bits_nibble(i64s x);

/* Eight bytes at p, p + step, p + 2 step ... */
INLINE i64s load_each(const uint8_t *p, size_t step);

/* Two neighbouring entries, table[i] in the lower half of a lane. */
INLINE i64s entries(const void *table, i64s i);

INLINE i64s entries16(const uint16_t *table, i64s i);

/* --- What follows from it ------------------------------------------------ */

INLINE i64s all(int64_t x)
{
    const i64s zero = { 0 };

    return zero + x;
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

/* A low value in all of its lane. */
INLINE i64s widen(i64s low)
{
    return (lower(low) ^ 0x80000000) - 0x80000000;
}

/* a b for |a| < 2^47, |b| < 2^31 and a product below 2^63. */
INLINE i64s mul_wide(i64s a, i64s b)
{
    return shift_up(mul(shift_down(a, 16), b), 16) + mul(a & 0xffff, b);
}

INLINE int64_t load64(const void *p)
{
    int64_t x;

    __builtin_memcpy(&x, p, sizeof x);
    return x;
}

#endif
#endif
