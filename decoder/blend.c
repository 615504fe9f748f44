/* SPDX-License-Identifier: MIT
 *
 * Blending a splat into a tile, row by row; docs/arithmetic.md has the norm.
 */
#include "blend.h"

#include "alpha.h"
#include "fx.h"
#include "fx_math.h"
#include "sqrt_up.h"

#define LIMIT_TAME ((int64_t)7 << 28)
#define LIMIT_W ((int64_t)7 << 27)   /* w^2 >= 12.25: beyond the cut */

/* A line of a patch: s = s_line + v^2 is below its reach at no pixel outside
 * [lo, hi). */
typedef struct {
    int32_t v;                   /* Q28, at lo; exact for lo..hi-1 */
    int32_t s_line;              /* w^2, Q20 */
    int32_t lo, hi;
} span;

/* q0 + s, or q0 + s + s^2 / 2 with s in Q12 for the square: where s is within
 * reach, that is below 2^14. */
static uint32_t q_of(uint32_t s, const saga_patch *p)
{
    const uint32_t r = (s + 128) >> 8;

    if (s >= (uint32_t)p->reach)
        return SAGA_CUT_Q20;
    s += (uint32_t)p->q0;
    return p->tools & SAGA_TOOL_STEEP ? s + ((r * r + 16) >> 5) : s;
}

/* |v| < 8, so the square of its 17 bits is below 2^32; s_line is below 2^27.
 * The pixels below the cut follow one another, since v grows with i. */
static void blend_line(uint32_t *t, uint32_t plane, const span *s,
                       const saga_patch *p)
{
    uint32_t v = (uint32_t)s->v + 0x4000u;
    int32_t i;
    int any = 0;

    t += s->lo;
    for (i = s->lo; i < s->hi; i++, v += (uint32_t)p->g, t++) {
        /* s = w^2 + v^2, v rounded to Q13 by the 2^14 it began with. */
        const uint32_t v13 = (uint32_t)((int32_t)v >> 15);
        const uint32_t q = q_of((uint32_t)s->s_line + ((v13 * v13 + 32) >> 6),
                                p);
        uint32_t w;

        /* Behind the last pixel of the ellipse none follows in this line. */
        if (q >= SAGA_CUT_Q20) {
            if (any)
                return;
            continue;
        }
        any = 1;
        if (*t < SAGA_T_FLOOR_Q16)
            continue;
        /* w = alpha T; T -= w; C += w colour: both below 2^32. */
        w = (alpha_q16(q) * *t + 0x8000u) >> 16;
        *t -= w;
        t[plane] += w * p->colour_q15[0];
        t[2 * plane] += w * p->colour_q15[1];
        t[3 * plane] += w * p->colour_q15[2];
    }
}

/* --- Tame patches -------------------------------------------------------- */

static int is_small(int64_t x)
{
    return x > -LIMIT_TAME && x < LIMIT_TAME;
}

/* v and w are linear, so their extremes are in the corners. */
static int is_tame(const saga_patch *p)
{
    const int64_t down = p->n_rows - 1;
    const int64_t left = p->v + (int64_t)p->g * p->x0;
    const int64_t right = p->v + (int64_t)p->g * (p->x1 - 1);
    const int64_t rise = p->n * down;

    return is_small(left) && is_small(right) && is_small(left - rise) &&
           is_small(right - rise) && is_small(p->w) &&
           is_small(p->w + p->h * down);
}

/* All of the box's columns: to find where the ellipse begins and ends takes
 * longer than to look at the pixels between it and the box. */
static void blend_tame(uint32_t *t, uint32_t side, const saga_patch *p)
{
    uint32_t v = (uint32_t)p->v + (uint32_t)p->g * (uint32_t)p->x0;
    uint32_t w = (uint32_t)p->w + 0x4000u;
    span s = { 0, 0, p->x0, p->x1 };
    uint32_t i;

    for (i = 0; i < p->n_rows; i++) {
        const uint32_t w13 = (uint32_t)((int32_t)w >> 15);

        s.v = (int32_t)v;
        s.s_line = (int32_t)((w13 * w13 + 32) >> 6);
        if (s.s_line < p->reach)
            blend_line(t, side * side, &s, p);
        /* A line down is dy + 1: v = g dx - n dy and w = h dy. */
        v -= (uint32_t)p->n;
        w += (uint32_t)p->h;
        t += side;
    }
}

/* --- Wild ones ----------------------------------------------------------- */

/* v and w at the centre of a line's first pixel, and 1/g = recip * 2^-shift. */
typedef struct {
    int64_t v, w;
    uint32_t recip;
    int shift;
} line;

/* Finds where |v + g i| < L for i in x0..x1-1, L = sqrt(reach - s_line) rounded
 * up: -L - v < g i < L - v. A bound outside 0..x1 g needs no division; inside,
 * it is below 2^35, times the reciprocal below 2^52, and the quotient, at most
 * 64, is off by less than 2^-8. So [lo, hi) misses no pixel, and reaches no
 * further than 1 + 2^-8 pixels beyond L: |v| <= 3.32 + 2.70 = 6.02 < 8 fits
 * Q28. Returns 0 where no pixel can pass. */
static int find_span(span *s, const line *l, const saga_patch *p)
{
    const int64_t reach = (int64_t)p->g * p->x1;
    int64_t limit, first, last;
    int32_t w13;

    if (l->w >= LIMIT_W || l->w <= -LIMIT_W)
        return 0;
    /* The line's own part of s, and whether it leaves anything for v^2. */
    w13 = fx_rshift((int32_t)l->w, 15);
    s->s_line = fx_rshift(w13 * w13, 6);
    if (s->s_line >= p->reach)
        return 0;
    limit = (int64_t)sqrt_up_q20_q12(p->reach - s->s_line) << 16;
    /* g i runs from first to last; the box's ends need no division. */
    first = -limit - l->v;
    last = limit - l->v;
    if (last <= 0 || (first >= reach && first >= 0))
        return 0;
    /* Rounded down, and two pixels up: the loop's own test decides. */
    s->lo = first <= 0 ? 0 : (int32_t)(first * l->recip >> l->shift);
    s->hi = last >= reach ? p->x1
          : fx_min((int32_t)(last * l->recip >> l->shift) + 2, p->x1);
    s->lo = fx_max(s->lo, p->x0);
    s->v = (int32_t)(l->v + (int64_t)p->g * s->lo);
    return s->lo < s->hi;
}

/* One line down dy grows by 256, so the steps are exact. */
static void blend_wild(uint32_t *t, uint32_t side, const saga_patch *p)
{
    line l = { p->v, p->w, 0, 0 };
    uint32_t i;
    span s;

    l.recip = saga_recip16((uint32_t)fx_max(p->g, 1), &l.shift);
    for (i = 0; i < p->n_rows; i++) {
        if (find_span(&s, &l, p))
            blend_line(t, side * side, &s, p);
        l.v -= p->n;
        l.w += p->h;
        t += side;
    }
}

static void blend_small(uint32_t *t, uint32_t side, const saga_patch *p,
                        saga_cpu cpu)
{
#ifdef SAGA_MAY_AVX2
    if (cpu >= SAGA_CPU_AVX2) {
        saga_blend__avx2(t, side, p);
        return;
    }
#endif
#ifdef SAGA_MAY_X4
    if (cpu >= SAGA_CPU_X4) {
        saga_blend__x4(t, side, p);
        return;
    }
#endif
    (void)cpu;
    blend_tame(t, side, p);
}

void saga_blend(uint32_t *t, uint32_t side, const saga_patch *p, saga_cpu cpu)
{
    if (is_tame(p))
        blend_small(t, side, p, cpu);
    else
        blend_wild(t, side, p);
}
