/* SPDX-License-Identifier: MIT
 *
 * The inner loop of blending: one splat into one tile. blend.c has the plain
 * loops, which are normative; arch/ has SIMD versions that give the same bits.
 */
#ifndef SAGA_BLEND_H
#define SAGA_BLEND_H

#include "cpu.h"
#include "model.h"

#include <stdint.h>

/* No pixel with s at or above this value, Q20, is touched. */
#define S_END (8u << 20)

/* The rows of a splat in a tile. v and w: docs/arithmetic.md. */
typedef struct saga_patch {
    int64_t v, w;    /* Q28, at the centre of the first row's first
                      * pixel; below 2^53 */
    int32_t g, n, h; /* Q28: steps of v to the right, of v upwards,
                      * of w downwards */
    int32_t q0;      /* Q20, below the cut */
    int32_t reach;   /* Q20: pixels with s at or above it are not
                      * touched (sqrt_up.h) */
    uint32_t tools;  /* with SAGA_TOOL_STEEP q = q0 + s + s^2 / 2,
                      * else q0 + s */
    int32_t x0, x1;  /* the columns [x0, x1) of the tile lie in the
                      * splat's box; x0 < x1 */
    uint32_t n_rows; /* >= 1, all inside the box */
    uint16_t colour_q15[3];
} saga_patch;

/* Blends p into a tile of side * side pixels (8..64), of which t is the first
 * pixel of p's first row: four planes T, R, G, B of uint32_t. Pixels with
 * T < 8 do not change. */
void saga_blend(uint32_t *t, uint32_t side, const saga_patch *p, saga_cpu cpu);

/* SIMD versions. The caller makes sure that |v| < 7 and |w| < 7 in the corners
 * of the box, so that 32 bits hold v and w. */
void saga_blend__avx2(uint32_t *t, uint32_t side, const saga_patch *p);
void saga_blend__x4(uint32_t *t, uint32_t side, const saga_patch *p);

#endif
