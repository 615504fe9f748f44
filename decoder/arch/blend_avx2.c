/* SPDX-License-Identifier: MIT
 *
 * Blending in AVX2. The polynomial needs 16 bits, and the upper halves of its
 * lanes stay zero.
 */
#include "blend.h"

#ifdef SAGA_MAY_AVX2

#define AVX2 __attribute__((target("avx2")))
#define INLINE static inline __attribute__((always_inline)) AVX2

#define LANES 8
#define PAIRS 1
#define IOTA                   \
    {                          \
        0, 1, 2, 3, 4, 5, 6, 7 \
    }

typedef int32_t i32s __attribute__((vector_size(32)));
typedef uint32_t u32s __attribute__((vector_size(32)));
typedef int16_t i16x16 __attribute__((vector_size(32)));

/* a b >> 16 in each of 16 lanes of 16 bits. */
INLINE u32s mulhi_u16(u32s a, u32s b)
{
    return (u32s)__builtin_ia32_pmulhuw256((i16x16)a, (i16x16)b);
}

/* Zero for shifts of 32 and more, which >> does not promise. */
INLINE u32s shift_each(u32s x, u32s n)
{
    return (u32s)__builtin_ia32_psrlv8si((i32s)x, (i32s)n);
}

INLINE u32s min_u32(u32s a, u32s b)
{
#ifdef __clang__
    return __builtin_elementwise_min(a, b);
#else
    return (u32s)__builtin_ia32_pminud256((i32s)a, (i32s)b);
#endif
}

INLINE u32s exp2_minus(u32s q)
{
    const u32s f2 = q << 5 | 16; /* Q16, in the lower half */
    const u32s p2 = 7661 - mulhi_u16(f2, (u32s){ 1366, 1366, 1366, 1366, 1366,
                                                 1366, 1366, 1366 });
    const u32s p1 = 22685 - mulhi_u16(f2, p2);

    return shift_each((32767 - mulhi_u16(f2, p1)) << (1 + SAGA_PEAK_LOG2),
                      q >> 11);
}

#include "blend_lanes.h"

AVX2 void saga_blend__avx2(uint32_t *t, uint32_t side, const saga_patch *p)
{
    blend_lanes(t, side, p);
}

#endif
