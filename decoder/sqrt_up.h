/* SPDX-License-Identifier: MIT
 *
 * An upper bound of a square root by one look into a table: how far a splat,
 * or a row of it, may reach. Boxes and spans made with it are loose by up to
 * 1/32 in q; every pixel is tested, so they never show in a picture.
 */
#ifndef SAGA_SQRT_UP_H
#define SAGA_SQRT_UP_H

#include "fx.h"

extern const uint16_t saga_sqrt_up_q12[256];

/* x_q20 in 1..2^24: at least sqrt(x + 1) + 1/3, Q12, at most 16386; loose by
 * 0.8 % for x >= 2^21. The part above the root itself covers the rounding of
 * v, w and q (norm 7): q < 11 with x = 11 - q0 means
 * w13^2 + v13^2 < 64 (x_q20 + 1), and v13, w13 in Q13 are half a unit off. */
static inline int32_t sqrt_up_q20_q12(int32_t x_q20)
{
    FX_ASSERT(x_q20 >= 1 && x_q20 <= 16 << 20);
    return x_q20 <= 8 << 20 ? saga_sqrt_up_q12[(x_q20 - 1) >> 15]
                            : 2 * saga_sqrt_up_q12[(x_q20 - 1) >> 17];
}

/* A splat touches only pixels whose s = v^2 + w^2 (Q20) is below this, given
 * rest = 11 - q0, 1..11 2^20, and the file's tools: where s itself reaches
 * rest, or with SAGA_TOOL_STEEP s + s^2 / 2 does, s = sqrt(1 + 2 rest) - 1.
 * The root comes by halves; a third of a unit of it above the root covers the
 * rounding of s^2 / 2, at most s 2^-13. At most 3.84 where it is steep. */
int32_t saga_reach_q20(int32_t rest_q20, uint32_t tools);

#endif
