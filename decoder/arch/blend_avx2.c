/* SPDX-License-Identifier: MIT
 *
 * Blending in AVX2, eight pixels of a row at a time. The numbers of rows and of
 * groups of eight are known before the first one, so that nothing is decided
 * per row; pixels outside the box are masked out, since their v may wrap
 * around.
 *
 * With Q = q in Q12, of which eight bits are the fraction,
 *     Q = (v^2 + 32 + 64 q_line) >> 18,  v in Q13,
 * one shift for the two of the norm: 64 q_line is a multiple of 64. v is below
 * 7 2^13 in the box: its square and 64 * 8 2^20 + 32 are below 2^32.
 *
 * 2^-f is blend.c's polynomial; it needs 16 bits, and the upper halves of its
 * lanes stay zero. Builtins and vector types rather than immintrin.h, which
 * wants a C library.
 */
#include "blend.h"

#ifdef SAGA_MAY_AVX2

#define AVX2 __attribute__((target("avx2")))
#define INLINE static inline __attribute__((always_inline)) AVX2

typedef int32_t i32x8 __attribute__((vector_size(32)));
typedef uint32_t u32x8 __attribute__((vector_size(32)));
typedef int16_t i16x16 __attribute__((vector_size(32)));

enum { ROWS = 16 };              /* whose v and q are held at a time */

INLINE u32x8 load(const uint32_t *p)
{
    u32x8 v;

    __builtin_memcpy(&v, p, sizeof v);
    return v;
}

INLINE void store(uint32_t *p, u32x8 v)
{
    __builtin_memcpy(p, &v, sizeof v);
}

INLINE u32x8 all(uint32_t x)
{
    const u32x8 zero = { 0 };

    return zero + x;
}

/* a b >> 16 in each of 16 lanes of 16 bits. */
INLINE u32x8 mulhi_u16(u32x8 a, u32x8 b)
{
    return (u32x8)__builtin_ia32_pmulhuw256((i16x16)a, (i16x16)b);
}

/* Zero for shifts of 32 and more, which >> does not promise. */
INLINE u32x8 shift_each(u32x8 x, u32x8 n)
{
    return (u32x8)__builtin_ia32_psrlv8si((i32x8)x, (i32x8)n);
}

INLINE u32x8 min_u32(u32x8 a, u32x8 b)
{
#ifdef __clang__
    return __builtin_elementwise_min(a, b);
#else
    return (u32x8)__builtin_ia32_pminud256((i32x8)a, (i32x8)b);
#endif
}

/* Eight columns. */
typedef struct {
    u32x8 steps;                 /* of v from the tile's first column */
    u32x8 outside;               /* 2^31 - 1 where not in the box, else 0 */
} group;

typedef struct {
    u32x8 colour[3];
} paint;

/* min(2^-q, cap) in Q16; q in Q12, 0 from the cut on. */
INLINE u32x8 alpha_q16(u32x8 q)
{
    const u32x8 f2 = q << 8 | 128;           /* Q16, in the lower half */
    const u32x8 p2 = 7775 - mulhi_u16(f2, all(1453));
    const u32x8 p1 = 22706 - mulhi_u16(f2, p2);
    const u32x8 m = (32767 - mulhi_u16(f2, p1)) << 1;
    const u32x8 a = min_u32(shift_each(m, q >> 8), all(SAGA_ALPHA_CAP_Q16));

    return a & (u32x8)((i32x8)q < SAGA_CUT_LOG2 << 8);
}

/* A group of a row: v at the tile's first column and k = 32 + 64 q_line are
 * the same in all lanes. */
INLINE void blend_group(uint32_t *t, uint32_t plane, u32x8 v, u32x8 k,
                        const group *c, const paint *p)
{
    const u32x8 v_q13 = (u32x8)((i32x8)(v + c->steps) >> 15);
    const u32x8 q = (v_q13 * v_q13 + k) >> 18 | c->outside;
    const u32x8 before = load(t);
    const u32x8 a = alpha_q16(q) &
                    (u32x8)((i32x8)before > SAGA_T_FLOOR_Q16 - 1);
    const u32x8 w = a * before >> 16;
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
    const u32x8 iota = { 0, 1, 2, 3, 4, 5, 6, 7 };
    const u32x8 v0 = all((uint32_t)p->v + 0x4000u);
    const u32x8 w0 = all((uint32_t)p->w + 0x4000u);
    uint32_t i;

    for (i = 0; i < ROWS; i += 8) {
        const u32x8 y = iota + (first + i);
        const u32x8 w_q13 =
            (u32x8)((i32x8)(w0 + y * (uint32_t)p->h) >> 15);
        const u32x8 q = ((w_q13 * w_q13 + 32) >> 6) + (uint32_t)p->q0;

        store(r->v + i, v0 - y * (uint32_t)p->n);
        store(r->k + i, (min_u32(q, all(SAGA_CUT_Q20)) << 6) + 32);
    }
}

INLINE void begin_group(group *c, const saga_patch *p, int32_t first)
{
    const i32x8 x = (i32x8){ 0, 1, 2, 3, 4, 5, 6, 7 } + first;

    c->steps = (u32x8)x * (uint32_t)p->g;
    c->outside = (u32x8)((x < p->x0) | (x >= p->x1)) >> 1;
}

/* One or two neighbouring groups of n rows. */
INLINE void blend_rows(uint32_t *t, uint32_t side, const rows *r,
                       const group *c, const paint *p, uint32_t n,
                       uint32_t n_groups)
{
    const uint32_t plane = side * side;
    uint32_t i;

    for (i = 0; i < n; i++, t += side) {
        const u32x8 v = all(r->v[i]), k = all(r->k[i]);

        blend_group(t, plane, v, k, c, p);
        if (n_groups == 2)
            blend_group(t + 8, plane, v, k, c + 1, p);
    }
}

AVX2 void saga_blend__avx2(uint32_t *t, uint32_t side, const saga_patch *p)
{
    const paint with = { { all(p->colour_q15[0]), all(p->colour_q15[1]),
                           all(p->colour_q15[2]) } };
    uint32_t row, n;

    for (row = 0; row < p->n_rows; row += n, t += n * side) {
        int32_t x = p->x0 & ~7;
        group c[2];
        rows r;

        n = p->n_rows - row < ROWS ? p->n_rows - row : ROWS;
        begin_rows(&r, p, row);
        for (; x + 8 < p->x1; x += 16) {
            begin_group(c, p, x);
            begin_group(c + 1, p, x + 8);
            blend_rows(t + x, side, &r, c, &with, n, 2);
        }
        if (x < p->x1) {
            begin_group(c, p, x);
            blend_rows(t + x, side, &r, c, &with, n, 1);
        }
    }
}

#endif
