/* SPDX-License-Identifier: MIT
 *
 * Integers of 64 bits in vectors of LANES. Two words describe lanes:
 *   low    only the lower half of the lane is valid, which is all that mul()
 *          reads; the upper half is undefined. Sums, differences and left
 *          shifts of low values are low
 *   small  the value fits 32 bits
 *
 * The file of a machine defines INLINE, the way in which functions are inlined,
 * and LANES; it includes this file and then defines the functions that are only
 * declared here. Compiler builtins and vector types are used because
 * immintrin.h needs a C library.
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

/* Return the product of the lower halves, as signed and as unsigned numbers. */
INLINE i64s mul(i64s a, i64s b);
INLINE u64s mul_u(u64s a, u64s b);

/* Shift each lane by the number in the same lane of n, 0..63. */
INLINE u64s shl(u64s x, u64s n);
INLINE u64s shr(u64s x, u64s n);

/* Compare small values. A lane of the result is low if one of its operands is.
 */
INLINE i64s max_small(i64s a, i64s b);
INLINE i64s min_small(i64s a, i64s b);

/* Returns -1 in lanes with x < 0, else 0. */
INLINE i64s negative(i64s x);

/* Returns a in lanes whose mask is -1, and b in lanes whose mask is 0. */
INLINE i64s select(i64s mask, i64s a, i64s b);

/* Returns fx_rshift64(x, n), for n in 1..62. */
INLINE i64s round_off(i64s x, int n);

/* Returns fx_rshift64(x, n), for n in 1..32; low, but valid in all of a lane
 * with x >= 0. */
INLINE i64s round_low(i64s x, int n);

/* A machine defines a struct `rounding`, which holds what it needs to shift
 * each lane by its own number n. round_by makes it for n in 0..62. round_each
 * applies fx_rshift64. round_low_each does so for n in 0..32; its result is
 * low, but valid in all of a lane with x >= 0.
 *     rounding round_by(i64s n)
 *     i64s round_each(i64s x, const rounding *r)
 *     i64s round_low_each(i64s x, const rounding *r) */

/* Returns the number of bits of x as an unsigned number, which is 0 for 0. */
INLINE i64s n_bits(i64s x);

/* Returns the number of bits of the lower half and of the upper half of x, each
 * in its half of the lane. */
INLINE i64s n_bits_halves(i64s x);

/* Returns the number of bits of x, which is in 0..15. */
INLINE i64s n_bits_nibble(i64s x);

/* Loads eight bytes from each of p, p + step, p + 2 step ... */
INLINE i64s load_each(const uint8_t *p, size_t step);

/* Loads two neighbouring entries of 32 bits: table[i] into the lower half of a
 * lane, table[i + 1] into the upper half. */
INLINE i64s entries(const void *table, i64s i);

INLINE i64s entries16(const uint16_t *table, i64s i);

/* --- Functions that follow from these ------------------------------------ */

INLINE i64s all(int64_t x)
{
    const i64s zero = { 0 };

    return zero + x;
}

INLINE i64s lower(i64s x)
{
    return x & 0xffffffff;
}

/* Shifts right, filling with zeros. */
INLINE i64s shift_down(i64s x, int n)
{
    return (i64s)((u64s)x >> n);
}

INLINE i64s shift_up(i64s x, int n)
{
    return (i64s)((u64s)x << n);
}

/* Clamps each lane to lo..hi. All differences must be below 2^63. */
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

/* Sign-extends a low value to all of its lane. */
INLINE i64s widen(i64s low)
{
    return (lower(low) ^ 0x80000000) - 0x80000000;
}

/* Returns a b for |a| < 2^47, |b| < 2^31 and a product below 2^63. */
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
