/* SPDX-License-Identifier: MIT
 *
 * An upper bound of a square root by one table lookup, which bounds the extent
 * of a splat or of a row of it. Boxes and spans made with it are too large by
 * up to 1/32 in q. Pictures do not depend on this, since every pixel is tested.
 */
#ifndef SAGA_SQRT_UP_H
#define SAGA_SQRT_UP_H

#include "fx.h"

extern const uint16_t saga_sqrt_up_q12[256];

/* For x_q20 in 1..2^24, returns at least sqrt(x + 1) + 1/3 in Q12, and at most
 * 16386. It exceeds the root by at most 0.8 % for x >= 2^21. The excess covers
 * the rounding of v, w and q (arithmetic.md, Blending): q < 11 with x = 11 - q0
 * means w13^2 + v13^2 < 64 (x_q20 + 1), where v13 and w13 in Q13 are wrong by
 * up to half a unit. */
static inline int32_t sqrt_up_q20_q12(int32_t x_q20)
{
    FX_ASSERT(x_q20 >= 1 && x_q20 <= 16 << 20);
    return x_q20 <= 8 << 20 ? saga_sqrt_up_q12[(x_q20 - 1) >> 15]
                            : 2 * saga_sqrt_up_q12[(x_q20 - 1) >> 17];
}

/* Returns a bound on s = v^2 + w^2 (Q20): a splat touches only pixels with s
 * below it. rest = 11 - q0 is in 1..11 2^20. The bound is rest; with
 * SAGA_TOOL_STEEP it is the s at which s + s^2 / 2 reaches rest, that is
 * sqrt(1 + 2 rest) - 1, which is at most 3.84. The root is computed from half
 * its argument; the third of a unit that sqrt_up adds covers the rounding of
 * s^2 / 2, which is at most s 2^-13. */
int32_t saga_reach_q20(int32_t rest_q20, uint32_t tools);

#endif
