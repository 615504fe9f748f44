/* SPDX-License-Identifier: MIT
 *
 * Blending in NEON, which multiplies 32 bits and shifts each lane by its own
 * number, so that the compiler's vectors are enough.
 */
#include "vector_x4.h"

#ifdef __ARM_NEON

#define INLINE static inline __attribute__((always_inline))

INLINE u32x4 mulhi_15(u32x4 a, u32x4 b)
{
    return a * b >> 15;
}

INLINE u32x4 shift_each(u32x4 m, u32x4 n)
{
    return m << 1 >> (n & 31);
}

#include "blend_x4.h"

void saga_blend__x4(uint32_t *t, uint32_t side, const saga_patch *p)
{
    blend_lanes(t, side, p);
}

#endif
