/* SPDX-License-Identifier: MIT
 *
 * Blending in vectors of 128 bits. The file of a machine defines INLINE and the
 * following functions, then includes this file:
 *
 *     u32x4 mulhi_15(u32x4 a, u32x4 b)      a b >> 15 in each lane, both
 *                                           below 2^15
 *     u32x4 shift_each(u32x4 m, u32x4 n)    2 m >> n for m below 2^15 and n in
 *                                           0..7; anything for other n
 */
#ifndef SAGA_BLEND_X4_H
#define SAGA_BLEND_X4_H

#include "model.h"
#include "vector_x4.h"

#ifdef INLINE

#define LANES 4
#define PAIRS 0
#define IOTA       \
    {              \
        0, 1, 2, 3 \
    }

typedef u32x4 u32s;
typedef i32x4 i32s;

INLINE u32s min_u32(u32s a, u32s b)
{
    const u32s is_less = (u32s)(a < b);

    return (a & is_less) | (b & ~is_less);
}

/* Returns 2^(3 - q). If q is below 3, it returns 65524, which is above the cap.
 */
INLINE u32s exp2_minus(u32s q)
{
    const i32s r = (i32s)q - (SAGA_PEAK_LOG2 << 11);
    const u32s rest = (u32s)(r & (r > 0));
    const u32s f = (rest & 2047) << 4 | 8;
    const u32s p2 = 7661 - mulhi_15(f, (u32s){ 1366, 1366, 1366, 1366 });
    const u32s p1 = 22685 - mulhi_15(f, p2);

    return shift_each(32767 - mulhi_15(f, p1), rest >> 11);
}

#include "blend_lanes.h"

#endif
#endif
