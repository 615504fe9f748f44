/* SPDX-License-Identifier: MIT
 *
 * The alpha of a splat at a pixel, 2^(3 - q), by one table lookup.
 */
#ifndef SAGA_ALPHA_H
#define SAGA_ALPHA_H

#include "model.h"

#include <stdint.h>

/* 2^-f in Q16 for the fraction of q rounded to 11 bits, f = 16 i + 8 in Q15:
 *     y = 7661 - (1366 f >> 15);  y = 22685 - (y f >> 15);
 *     entry = 2 (32767 - (y f >> 15))
 * The three constants minimise the mean squared error over all q. */
extern const uint16_t saga_exp2_neg_q16[2048];

/* Returns min(2^(3 - q), cap) for q below the cut. The error of the table is at
 * most 2.8e-4 of 2^(3 - floor(q)). The result never rises with q. */
static inline uint32_t alpha_q16(uint32_t q_q20)
{
    const uint32_t y = saga_exp2_neg_q16[q_q20 >> 9 & 2047u];
    const uint32_t a = y << SAGA_PEAK_LOG2 >> (q_q20 >> 20);

    return a < SAGA_ALPHA_CAP_Q16 ? a : SAGA_ALPHA_CAP_Q16;
}

#endif
