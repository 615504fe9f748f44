/* SPDX-License-Identifier: MIT
 *
 * lanes.h with NEON, which has two lanes. NEON shifts each lane by its own
 * number, to the right if the number is negative, and rounds as fx_rshift64
 * does.
 */
#ifndef SAGA_LANES_NEON_H
#define SAGA_LANES_NEON_H

#include "cpu.h"

#ifdef SAGA_MAY_NEON

#include <arm_neon.h>

#define INLINE static inline __attribute__((always_inline))
#define LANES 2

#include "lanes.h"

INLINE i64s mul(i64s a, i64s b)
{
    return (i64s)vmull_s32(vmovn_s64((int64x2_t)a), vmovn_s64((int64x2_t)b));
}

INLINE u64s mul_u(u64s a, u64s b)
{
    return (u64s)vmull_u32(vmovn_u64((uint64x2_t)a), vmovn_u64((uint64x2_t)b));
}

INLINE u64s shl(u64s x, u64s n)
{
    return (u64s)vshlq_u64((uint64x2_t)x, (int64x2_t)n);
}

INLINE u64s shr(u64s x, u64s n)
{
    return (u64s)vshlq_u64((uint64x2_t)x, (int64x2_t)(0 - n));
}

INLINE i64s max_small(i64s a, i64s b)
{
    return (i64s)vmaxq_s32((int32x4_t)a, (int32x4_t)b);
}

INLINE i64s min_small(i64s a, i64s b)
{
    return (i64s)vminq_s32((int32x4_t)a, (int32x4_t)b);
}

INLINE i64s negative(i64s x)
{
    return (i64s)vshrq_n_s64((int64x2_t)x, 63);
}

INLINE i64s select(i64s mask, i64s a, i64s b)
{
    return (i64s)vbslq_s64((uint64x2_t)mask, (int64x2_t)a, (int64x2_t)b);
}

typedef struct {
    int64x2_t up; /* -n */
} rounding;

INLINE rounding round_by(i64s n)
{
    rounding r;

    r.up = (int64x2_t)(0 - n);
    return r;
}

INLINE i64s round_each(i64s x, const rounding *r)
{
    return (i64s)vrshlq_s64((int64x2_t)x, r->up);
}

INLINE i64s round_low_each(i64s x, const rounding *r)
{
    return round_each(x, r);
}

INLINE i64s round_off(i64s x, int n)
{
    const rounding r = round_by(all(n));

    return round_each(x, &r);
}

INLINE i64s round_low(i64s x, int n)
{
    return round_off(x, n);
}

INLINE i64s n_bits_halves(i64s x)
{
    return (i64s)(32 - (u32s)vclzq_u32((uint32x4_t)x));
}

/* If the upper half is 0, the bits of the lower half are counted. */
INLINE i64s n_bits(i64s x)
{
    const i64s zeros = (i64s)vclzq_u32((uint32x4_t)x);
    const i64s high = shift_down(zeros, 32);

    return 64 - high - (zeros & (0 - shift_down(high, 5)) & 63);
}

INLINE i64s n_bits_nibble(i64s x)
{
    return n_bits_halves(x);
}

INLINE i64s load_each(const uint8_t *p, size_t step)
{
    return (i64s){ load64(p), load64(p + step) };
}

INLINE i64s entries(const void *table, i64s i)
{
    const uint8_t *const t = table;

    return (i64s){ load64(t + 4 * i[0]), load64(t + 4 * i[1]) };
}

INLINE i64s entries16(const uint16_t *t, i64s i)
{
    return (i64s){ t[i[0]], t[i[1]] };
}

#endif
#endif
