/* SPDX-License-Identifier: MIT
 *
 * Blending in vectors of LANES pixels of a row. The numbers of rows and of
 * groups of LANES pixels are known before the first row, so that rows need no
 * branches. Pixels outside the box are masked out, because their v may wrap
 * around.
 *
 * The norm rounds q to eleven bits of fraction in two shifts. Here one shift
 * gives the same result, Q in Q11, because 64 q_line is a multiple of 64:
 *     Q = (v^2 + 32 + 64 q_line) >> 15,  v in Q13.
 * In the box v is below 7 2^13, so that v^2 and 64 * 11 2^20 + 32 are below
 * 2^32. For steep splats the same formula computes s from s_line, which is at
 * most 8 2^20.
 *
 * 2^-f is the polynomial of alpha.h. Compiler builtins and vector types are
 * used because immintrin.h needs a C library. The file of a machine defines the
 * following, then includes this file:
 *
 *     INLINE, LANES             how functions are inlined; 4 or 8
 *     PAIRS                     1: two groups of a row are blended at a time
 *     u32s, i32s, IOTA          vectors of LANES; { 0, 1, 2, .. }
 *     u32s min_u32(u32s, u32s)
 *     u32s exp2_minus(u32s q)   2^(3 - q) in Q16 for q in Q11 below the cut; if
 *                               that exceeds the cap, any larger value than the
 *                               cap. Undefined for other q
 */
#ifndef SAGA_BLEND_LANES_H
#define SAGA_BLEND_LANES_H

#include "blend.h"

#ifdef LANES

enum { ROWS = 16 }; /* rows whose v and q are stored at a time */

INLINE u32s all(uint32_t x)
{
    const u32s zero = { 0 };

    return zero + x;
}

INLINE u32s load(const uint32_t *p)
{
    u32s v;

    __builtin_memcpy(&v, p, sizeof v);
    return v;
}

INLINE void store(uint32_t *p, u32s v)
{
    __builtin_memcpy(p, &v, sizeof v);
}

/* A group of LANES columns that are blended together. */
typedef struct {
    u32s steps;   /* change of v since the tile's first column */
    u32s outside; /* 2^31 - 1 in lanes outside the box, else 0 */
} group;

typedef struct {
    u32s colour[3];
    u32s q0; /* where it is steep */
} paint;

/* Returns min(2^(3 - q), cap) in Q16; q in Q11, 0 from the cut on. */
INLINE u32s alpha_q16(u32s q)
{
    const u32s a = min_u32(exp2_minus(q), all(SAGA_ALPHA_CAP_Q16));

    return a & (u32s)((i32s)q < SAGA_CUT_LOG2 << 11);
}

/* blend.c's q_of, in Q11. */
INLINE u32s steep_q11(u32s s, u32s q0)
{
    const u32s r = (min_u32(s, all(S_END - 1)) + 128) >> 8;

    return (s + q0 + ((r * r + 16) >> 5)) >> 9;
}

/* Blends a group of a row. All lanes of v hold the value at the tile's first
 * column, and all lanes of k hold 32 + 64 q_line or, for steep splats, 32 + 64
 * s_line. */
INLINE void blend_group(uint32_t *t, uint32_t plane, u32s v, u32s k,
                        const group *c, const paint *p, uint32_t tools)
{
    const u32s v_q13 = (u32s)((i32s)(v + c->steps) >> 15);
    const u32s sum = v_q13 * v_q13 + k;
    const u32s q = c->outside |
                   (tools & SAGA_TOOL_STEEP ? steep_q11(sum >> 6, p->q0)
                                            : sum >> 15);
    const u32s before = load(t);
    /* alpha is 0 in finished pixels, whose T is below its floor. */
    const u32s a = alpha_q16(q) & (u32s)((i32s)before > SAGA_T_FLOOR_Q16 - 1);
    const u32s w = (a * before + 0x8000u) >> 16;
    uint32_t i;

    store(t, before - w);
    for (i = 0; i < 3; i++) {
        t += plane;
        store(t, load(t) + w * p->colour[i]);
    }
}

/* For up to ROWS rows: v + 2^14, so that a right shift rounds v, and k. */
typedef struct {
    uint32_t v[ROWS], k[ROWS];
} rows;

/* Computes v and k of the rows. |w| < 7, so that its square in Q20 is below
 * 2^26, and q_line is below 2^27. */
INLINE void begin_rows(rows *r, const saga_patch *p, uint32_t first,
                       uint32_t tools)
{
    const u32s iota = IOTA;
    const u32s v0 = all((uint32_t)p->v + 0x4000u);
    const u32s w0 = all((uint32_t)p->w + 0x4000u);
    const uint32_t begin = tools & SAGA_TOOL_STEEP ? 0 : (uint32_t)p->q0;
    const uint32_t end = tools & SAGA_TOOL_STEEP ? S_END : SAGA_CUT_Q20;
    uint32_t i;

    for (i = 0; i < ROWS; i += LANES) {
        const u32s y = iota + (first + i);
        const u32s w_q13 = (u32s)((i32s)(w0 + y * (uint32_t)p->h) >> 15);
        const u32s q = ((w_q13 * w_q13 + 32) >> 6) + begin;

        store(r->v + i, v0 - y * (uint32_t)p->n);
        /* All q beyond the cut become one value, so that 64 q fits 32 bits. */
        store(r->k + i, (min_u32(q, all(end)) << 6) + 32);
    }
}

INLINE void begin_group(group *c, const saga_patch *p, int32_t first)
{
    const i32s x = (i32s)IOTA + first;

    c->steps = (u32s)x * (uint32_t)p->g;
    c->outside = (u32s)((x < p->x0) | (x >= p->x1)) >> 1;
}

/* Blends one group, or two neighbouring groups, of n rows. */
INLINE void blend_rows(uint32_t *t, uint32_t side, const rows *r,
                       const group *c, const paint *p, uint32_t n,
                       uint32_t n_groups, uint32_t tools)
{
    const uint32_t plane = side * side;
    uint32_t i;

    for (i = 0; i < n; i++, t += side) {
        const u32s v = all(r->v[i]), k = all(r->k[i]);

        blend_group(t, plane, v, k, c, p, tools);
        if (n_groups == 2)
            blend_group(t + LANES, plane, v, k, c + 1, p, tools);
    }
}

INLINE void blend_kind(uint32_t *t, uint32_t side, const saga_patch *p,
                       uint32_t tools)
{
    const paint with = { { all(p->colour_q15[0]), all(p->colour_q15[1]),
                           all(p->colour_q15[2]) },
                         all((uint32_t)p->q0) };
    uint32_t row, n;

    for (row = 0; row < p->n_rows; row += n, t += n * side) {
        int32_t x = p->x0 & ~(LANES - 1);
        group c[2];
        rows r;

        n = p->n_rows - row < ROWS ? p->n_rows - row : ROWS;
        /* v and k of the rows are computed once; then the groups are blended
         * column by column. */
        begin_rows(&r, p, row, tools);
        for (; PAIRS && x + LANES < p->x1; x += 2 * LANES) {
            begin_group(c, p, x);
            begin_group(c + 1, p, x + LANES);
            blend_rows(t + x, side, &r, c, &with, n, 2, tools);
        }
        for (; x < p->x1; x += LANES) {
            begin_group(c, p, x);
            blend_rows(t + x, side, &r, c, &with, n, 1, tools);
        }
    }
}

INLINE void blend_lanes(uint32_t *t, uint32_t side, const saga_patch *p)
{
    if (p->tools & SAGA_TOOL_STEEP)
        blend_kind(t, side, p, SAGA_TOOL_STEEP);
    else
        blend_kind(t, side, p, 0);
}

#endif
#endif
