/* SPDX-License-Identifier: MIT
 *
 * Blends a splat into a tile, row by row; docs/arithmetic.md is normative.
 */
#include "blend.h"

#include "alpha.h"
#include "fx.h"
#include "fx_math.h"
#include "sqrt_up.h"

#define LIMIT_TAME ((int64_t)7 << 28)
#define LIMIT_W ((int64_t)7 << 27) /* w^2 >= 12.25 is beyond the cut */

/* The part of a line that a splat may touch: outside [lo, hi), s = s_line + v^2
 * is at or above the patch's reach. */
typedef struct {
    int32_t v;      /* Q28, at lo; exact for lo..hi-1 */
    int32_t s_line; /* w^2, Q20 */
    int32_t lo, hi;
} span;

/* Returns q at a pixel with the given s: q0 + s, or for steep splats q0 + s +
 * s^2 / 2. The square uses s in Q12, which is below 2^14 for any s within
 * reach; for larger s the result is above the cut. */
static uint32_t q_of(uint32_t s, const saga_patch *p)
{
    const uint32_t r = (s + 128) >> 8;

    if (s >= (uint32_t)p->reach)
        return SAGA_CUT_Q20;
    s += (uint32_t)p->q0;
    return p->tools & SAGA_TOOL_STEEP ? s + ((r * r + 16) >> 5) : s;
}

/* Blends one line. |v| < 8 has 17 bits in Q13, so that its square is below
 * 2^32; s_line is below 2^27. Since v grows with i, the pixels below the cut
 * are contiguous. */
static void blend_line(uint32_t *t, uint32_t plane, const span *s,
                       const saga_patch *p)
{
    uint32_t v = (uint32_t)s->v + 0x4000u;
    int32_t i;
    int any = 0;

    t += s->lo;
    for (i = s->lo; i < s->hi; i++, v += (uint32_t)p->g, t++) {
        /* s = w^2 + v^2. v has 2^14 more, so that the shift to Q13 rounds. */
        const uint32_t v13 = (uint32_t)((int32_t)v >> 15);
        const uint32_t q = q_of((uint32_t)s->s_line + ((v13 * v13 + 32) >> 6),
                                p);
        uint32_t w;

        /* The ellipse has no further pixels in this line. */
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

/* --- Tame patches: v and w fit 32 bits everywhere in the box -------------- */

static int is_small(int64_t x)
{
    return x > -LIMIT_TAME && x < LIMIT_TAME;
}

/* Returns whether v and w fit 32 bits in the whole box. They are linear, so
 * that it is enough to test the corners. */
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

/* Tests all columns of the box, because finding the ends of the ellipse would
 * take longer than testing the pixels between it and the box. */
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
        /* The next line has dy + 1, and v = g dx - n dy, w = h dy. */
        v -= (uint32_t)p->n;
        w += (uint32_t)p->h;
        t += side;
    }
}

/* --- Wild patches: all others --------------------------------------------- */

/* v and w at the centre of a line's first pixel, and 1/g = recip * 2^-shift. */
typedef struct {
    int64_t v, w;
    uint32_t recip;
    int shift;
} line;

/* Finds a span [lo, hi) that contains all i in x0..x1-1 with |v + g i| < L,
 * that is -L - v < g i < L - v, where L = sqrt(reach - s_line), rounded up. A
 * bound outside 0..x1 g needs no division. A bound inside is below 2^35; its
 * product with the reciprocal is below 2^52, and the quotient, at most 64, has
 * an error below 2^-8. The span extends beyond L by at most 1 + 2^-8 pixels, so
 * that |v| <= 3.32 + 2.70 = 6.02 < 8 fits Q28. Returns 0 if the span is empty.
 */
static int find_span(span *s, const line *l, const saga_patch *p)
{
    const int64_t reach = (int64_t)p->g * p->x1;
    int64_t limit, first, last;
    int32_t w13;

    if (l->w >= LIMIT_W || l->w <= -LIMIT_W)
        return 0;
    /* If w^2 alone reaches the limit of s, no pixel passes. */
    w13 = fx_rshift((int32_t)l->w, 15);
    s->s_line = fx_rshift(w13 * w13, 6);
    if (s->s_line >= p->reach)
        return 0;
    limit = (int64_t)sqrt_up_q20_q12(p->reach - s->s_line) << 16;
    /* g i must lie between first and last. */
    first = -limit - l->v;
    last = limit - l->v;
    if (last <= 0 || (first >= reach && first >= 0))
        return 0;
    /* The lower end is rounded down, and the upper end is two pixels up; the
     * loop tests each pixel anyway. */
    s->lo = first <= 0 ? 0 : (int32_t)(first * l->recip >> l->shift);
    s->hi = last >= reach
                ? p->x1
                : fx_min((int32_t)(last * l->recip >> l->shift) + 2, p->x1);
    s->lo = fx_max(s->lo, p->x0);
    s->v = (int32_t)(l->v + (int64_t)p->g * s->lo);
    return s->lo < s->hi;
}

/* Blends a patch whose v or w may exceed 32 bits at pixels that the splat does
 * not reach. From line to line dy grows by 256 (a pixel), so that v and w
 * change by exactly n and h. */
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
