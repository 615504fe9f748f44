/* SPDX-License-Identifier: MIT
 *
 * A splat covers 2^(3 - q) of a pixel; one look into a table tells it.
 */
#ifndef SAGA_ALPHA_H
#define SAGA_ALPHA_H

#include "model.h"

#include <stdint.h>

/* 2^-f in Q16 for the fraction of q rounded to 11 bits, f = 16 i + 8 in Q15:
 *     y = 7661 - (1366 f >> 15);  y = 22685 - (y f >> 15);
 *     entry = 2 (32767 - (y f >> 15))
 * The three constants are those of the least mean square error over all q. */
extern const uint16_t saga_exp2_neg_q16[2048];

/* alpha of q below the cut, at most the cap; the table's error is at most
 * 2.8e-4 of 2^(3 - floor(q)). It never rises. */
static inline uint32_t alpha_q16(uint32_t q_q20)
{
    const uint32_t y = saga_exp2_neg_q16[q_q20 >> 9 & 2047u];
    const uint32_t a = y << SAGA_PEAK_LOG2 >> (q_q20 >> 20);

    return a < SAGA_ALPHA_CAP_Q16 ? a : SAGA_ALPHA_CAP_Q16;
}

#endif
