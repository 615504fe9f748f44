/* SPDX-License-Identifier: MIT
 *
 * Blending with WebAssembly's vectors. It shifts all lanes by one number and
 * multiplies 32 bits slowly. Products of numbers below 2^15 therefore go
 * through the inner product of 16 bits, whose other half is zero, and 2^-n for
 * n in 0..7 comes from a table of bytes.
 */
#include "vector_x4.h"

#ifdef __wasm_simd128__

#define INLINE static inline __attribute__((always_inline))

typedef int8_t i8x16 __attribute__((vector_size(16)));

INLINE u32x4 mulhi_15(u32x4 a, u32x4 b)
{
    return (u32x4)__builtin_wasm_dot_s_i32x4_i16x8((i16x8)a, (i16x8)b) >> 15;
}

/* As m 2^(7 - n) >> 6. Indices above 15, of a lane's upper bytes, look up 0. */
INLINE u32x4 shift_each(u32x4 m, u32x4 n)
{
    const i8x16 table = { -128, 64, 32, 16, 8, 4, 2, 1 };
    const i8x16 power = __builtin_wasm_swizzle_i8x16(table,
                                                     (i8x16)(n | 0x80808000u));

    return (u32x4)__builtin_wasm_dot_s_i32x4_i16x8((i16x8)m, (i16x8)power) >> 6;
}

#include "blend_x4.h"

void saga_blend__x4(uint32_t *t, uint32_t side, const saga_patch *p)
{
    blend_lanes(t, side, p);
}

#endif
