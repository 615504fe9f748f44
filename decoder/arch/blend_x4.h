/* SPDX-License-Identifier: MIT
 *
 * Blending in vectors of 128 bits, four pixels of a row at a time, as
 * blend_avx2.c does eight; its comment derives the formulas. A file of a
 * machine defines what machines have differently and then includes this:
 *
 *     INLINE   how its functions are inlined
 *     u32x4 mulhi_15(u32x4 a, u32x4 b)      a b >> 15 in each lane, both
 *                                           below 2^15
 *     u32x4 shift_each(u32x4 m, u32x4 n)    2 m >> n for m below 2^15 and n in
 *                                           0..7; anything for other n
 */
#ifndef SAGA_BLEND_X4_H
#define SAGA_BLEND_X4_H

#include "blend.h"
#include "vector_x4.h"

#ifdef INLINE

enum { ROWS = 16 };              /* whose v and q are held at a time */

INLINE u32x4 load(const uint32_t *p)
{
    u32x4 v;

    __builtin_memcpy(&v, p, sizeof v);
    return v;
}

INLINE void store(uint32_t *p, u32x4 v)
{
    __builtin_memcpy(p, &v, sizeof v);
}

INLINE u32x4 all(uint32_t x)
{
    const u32x4 zero = { 0 };

    return zero + x;
}

INLINE u32x4 min_u32(u32x4 a, u32x4 b)
{
    const u32x4 is_less = (u32x4)(a < b);

    return (a & is_less) | (b & ~is_less);
}

/* Four columns. */
typedef struct {
    u32x4 steps;                 /* of v from the tile's first column */
    u32x4 outside;               /* 2^31 - 1 where not in the box, else 0 */
} group;

typedef struct {
    u32x4 colour[3];
} paint;

/* min(2^-q, cap) in Q16; q in Q12, 0 from the cut on. */
INLINE u32x4 alpha_q16(u32x4 q)
{
    const u32x4 f = (q & 255) << 7 | 64;
    const u32x4 p2 = 7775 - mulhi_15(f, all(1453));
    const u32x4 p1 = 22706 - mulhi_15(f, p2);
    const u32x4 m = 32767 - mulhi_15(f, p1);
    const u32x4 a = min_u32(shift_each(m, q >> 8), all(SAGA_ALPHA_CAP_Q16));

    return a & (u32x4)((i32x4)q < SAGA_CUT_LOG2 << 8);
}

/* A group of a row: v at the tile's first column and k = 32 + 64 q_line are
 * the same in all lanes. */
INLINE void blend_group(uint32_t *t, uint32_t plane, u32x4 v, u32x4 k,
                        const group *c, const paint *p)
{
    const u32x4 v_q13 = (u32x4)((i32x4)(v + c->steps) >> 15);
    const u32x4 q = (v_q13 * v_q13 + k) >> 18 | c->outside;
    const u32x4 before = load(t);
    const u32x4 a = alpha_q16(q) &
                    (u32x4)((i32x4)before > SAGA_T_FLOOR_Q16 - 1);
    const u32x4 w = a * before >> 16;
    uint32_t i;

    store(t, before - w);
    for (i = 0; i < 3; i++) {
        t += plane;
        store(t, load(t) + w * p->colour[i]);
    }
}

/* v + 2^14, so that a shift rounds it, and k of up to ROWS rows. */
typedef struct {
    uint32_t v[ROWS], k[ROWS];
} rows;

/* w below 7: its square in Q20 is below 2^26, q_line below 2^27. */
INLINE void begin_rows(rows *r, const saga_patch *p, uint32_t first)
{
    const u32x4 iota = { 0, 1, 2, 3 };
    const u32x4 v0 = all((uint32_t)p->v + 0x4000u);
    const u32x4 w0 = all((uint32_t)p->w + 0x4000u);
    uint32_t i;

    for (i = 0; i < ROWS; i += 4) {
        const u32x4 y = iota + (first + i);
        const u32x4 w_q13 =
            (u32x4)((i32x4)(w0 + y * (uint32_t)p->h) >> 15);
        const u32x4 q = ((w_q13 * w_q13 + 32) >> 6) + (uint32_t)p->q0;

        store(r->v + i, v0 - y * (uint32_t)p->n);
        store(r->k + i, (min_u32(q, all(SAGA_CUT_Q20)) << 6) + 32);
    }
}

INLINE void begin_group(group *c, const saga_patch *p, int32_t first)
{
    const i32x4 x = (i32x4){ 0, 1, 2, 3 } + first;

    c->steps = (u32x4)x * (uint32_t)p->g;
    c->outside = (u32x4)((x < p->x0) | (x >= p->x1)) >> 1;
}

/* n rows of a group. */
INLINE void blend_rows(uint32_t *t, uint32_t side, const rows *r,
                       const group *c, const paint *p, uint32_t n)
{
    uint32_t i;

    for (i = 0; i < n; i++, t += side)
        blend_group(t, side * side, all(r->v[i]), all(r->k[i]), c, p);
}

INLINE void blend_x4(uint32_t *t, uint32_t side, const saga_patch *p)
{
    const paint with = { { all(p->colour_q15[0]), all(p->colour_q15[1]),
                           all(p->colour_q15[2]) } };
    uint32_t row, n;

    for (row = 0; row < p->n_rows; row += n, t += n * side) {
        int32_t x;
        rows r;

        n = p->n_rows - row < ROWS ? p->n_rows - row : ROWS;
        begin_rows(&r, p, row);
        for (x = p->x0 & ~3; x < p->x1; x += 4) {
            group c;

            begin_group(&c, p, x);
            blend_rows(t + x, side, &r, &c, &with, n);
        }
    }
}

#endif
#endif
