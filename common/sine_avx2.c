/* SPDX-License-Identifier: MIT
 *
 * The sines of sine.h with AVX2, used if it is detected at run time. (SSE2
 * cannot multiply four 32-bit words.)
 */
#include "fx_math.h"

#ifdef SAGA_SINE_MAY_AVX2

#define AVX2 __attribute__((target("avx2")))
#define INLINE static inline __attribute__((always_inline)) AVX2
#include "sine.h"

AVX2 void saga_sin_turn16_each__avx2(int16_t *sine_q15, const uint16_t *phase,
                                     uint32_t n)
{
    sin_turn16_each(sine_q15, phase, n);
}

#endif
