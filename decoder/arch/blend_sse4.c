/* SPDX-License-Identifier: MIT
 *
 * Blending in SSE4.1, which has no shifts of each lane by its own number:
 * 2^-n for n in 0..7 comes from a table of bytes.
 */
#include "cpu.h"
#include "vector_x4.h"

#ifdef SAGA_MAY_AVX2

#define SSE4 __attribute__((target("sse4.1")))
#define INLINE static inline __attribute__((always_inline)) SSE4

typedef char i8x16 __attribute__((vector_size(16)));

INLINE u32x4 mulhi_15(u32x4 a, u32x4 b)
{
    return (u32x4)__builtin_ia32_pmaddwd128((i16x8)a, (i16x8)b) >> 15;
}

/* As m 2^(7 - n) >> 6. Indices with their highest bit set look up 0. */
INLINE u32x4 shift_each(u32x4 m, u32x4 n)
{
    const i8x16 table = { -128, 64, 32, 16, 8, 4, 2, 1 };
    const i8x16 power = __builtin_ia32_pshufb128(table,
                                                 (i8x16)(n | 0x80808000u));

    return (u32x4)__builtin_ia32_pmaddwd128((i16x8)m, (i16x8)power) >> 6;
}

#include "blend_x4.h"

SSE4 void saga_blend__x4(uint32_t *t, uint32_t side, const saga_patch *p)
{
    blend_lanes(t, side, p);
}

#endif
