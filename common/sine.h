/* SPDX-License-Identifier: MIT
 *
 * The sine, for one phase and for many. fx_math.c and sine_avx2.c compile the
 * same code for different instruction sets. They define INLINE, the specifiers
 * of its functions.
 */
#ifndef SAGA_SINE_H
#define SAGA_SINE_H

#include "fx.h"

#ifdef INLINE

/* sin(z pi/2), z in [0, 1] as Q14 0..16384, by z (c0 - u (c1 - u (c2 - u c3)))
 * with u = z^2. The coefficients (Q17, Q16, Q18, Q18) minimise the maximum
 * error over all z; they were found by search around the minimax polynomial.
 *   u <= 2^16
 *   c2_q18 in 19690..20822; u c2_q18 <= 2^16 * 20822 < 2^31
 *   c1_q16 in 37409..42331; u c1_q16 <= 2^16 * 42331 < 2^32 - 2^14
 *   z c0_q17 <= 2^14 * 205889 < 2^32 - 2^15
 * Error: 0.82 LSB, and 1 where the value 32768 saturates. */
INLINE int32_t sin_quarter_q15(uint32_t z)
{
    const uint32_t u = (z * z + (1u << 11)) >> 12;
    const uint32_t c2_q18 = 20822u - ((1132u * u + (1u << 15)) >> 16);
    const uint32_t c1_q16 = 42331u - ((c2_q18 * u + (1u << 17)) >> 18);
    const uint32_t c0_q17 = 205889u - ((c1_q16 * u + (1u << 14)) >> 15);

    return fx_min((int32_t)((c0_q17 * z + (1u << 15)) >> 16), 32767);
}

/* Reduces the phase to the first quarter turn, so that the result is odd and
 * symmetric by construction. */
INLINE int16_t sin_turn16_q15(uint32_t phase)
{
    const int32_t half = (int32_t)(phase & 32767u);
    const int32_t y = sin_quarter_q15((uint32_t)fx_min(half, 32768 - half));

    return (int16_t)(phase & 32768u ? -y : y);
}

INLINE void sin_turn16_each(int16_t *restrict sine_q15,
                            const uint16_t *restrict phase, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        sine_q15[i] = sin_turn16_q15(phase[i]);
}

#endif
#endif
