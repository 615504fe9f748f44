/* SPDX-License-Identifier: MIT
 *
 * Blending a splat into a tile, row by row; docs/arithmetic.md has the norm.
 */
#include "blend.h"

#include "fx.h"
#include "fx_math.h"
#include "sqrt_up.h"

#define LIMIT_TAME ((int64_t)7 << 28)
#define LIMIT_W ((int64_t)3 << 28)   /* w^2 >= 9: beyond the cut */

/* A line of a patch: q = q_line + v^2 is below the cut at no pixel outside
 * [lo, hi). */
typedef struct {
    int32_t v;                   /* Q28, at lo; exact for lo..hi-1 */
    int32_t q_line;              /* q0 + w^2, Q20 */
    int32_t lo, hi;
} span;

/* 2^-f in Q16 for the fraction of q rounded to 8 bits, f = 128 i + 64 in Q15:
 *     u = 7775 - (1453 f >> 15);  u = 22706 - (u f >> 15);
 *     entry = 2 (32767 - (u f >> 15))                                     */
static const uint16_t exp2_neg_q16[256] = {
    65446, 65270, 65092, 64918, 64742, 64566, 64392, 64218, 64044, 63872, 63698,
    63526, 63354, 63184, 63012, 62842, 62672, 62502, 62334, 62164, 61996, 61828,
    61662, 61496, 61328, 61162, 60998, 60832, 60668, 60504, 60340, 60178, 60014,
    59852, 59690, 59528, 59368, 59208, 59048, 58888, 58728, 58570, 58410, 58254,
    58096, 57938, 57782, 57626, 57470, 57314, 57160, 57004, 56850, 56698, 56544,
    56390, 56238, 56086, 55934, 55784, 55632, 55482, 55332, 55184, 55034, 54886,
    54736, 54588, 54442, 54294, 54148, 54002, 53856, 53710, 53564, 53420, 53276,
    53132, 52988, 52844, 52702, 52560, 52418, 52276, 52136, 51994, 51854, 51714,
    51574, 51434, 51296, 51158, 51020, 50882, 50744, 50608, 50470, 50334, 50198,
    50062, 49928, 49792, 49658, 49524, 49390, 49258, 49124, 48992, 48860, 48728,
    48596, 48466, 48334, 48204, 48074, 47944, 47816, 47686, 47558, 47428, 47302,
    47174, 47046, 46920, 46792, 46666, 46542, 46416, 46290, 46166, 46042, 45916,
    45792, 45670, 45548, 45424, 45302, 45180, 45058, 44936, 44814, 44694, 44574,
    44452, 44334, 44214, 44094, 43976, 43858, 43740, 43620, 43504, 43386, 43270,
    43154, 43036, 42920, 42806, 42690, 42574, 42460, 42346, 42232, 42118, 42004,
    41890, 41778, 41664, 41552, 41440, 41330, 41216, 41106, 40996, 40884, 40774,
    40666, 40554, 40444, 40336, 40226, 40120, 40010, 39902, 39794, 39688, 39580,
    39474, 39368, 39262, 39156, 39050, 38944, 38838, 38736, 38630, 38526, 38422,
    38318, 38212, 38110, 38008, 37904, 37802, 37700, 37598, 37496, 37394, 37294,
    37192, 37092, 36992, 36890, 36792, 36692, 36592, 36494, 36396, 36296, 36198,
    36100, 36002, 35904, 35806, 35710, 35614, 35516, 35420, 35324, 35226, 35130,
    35036, 34942, 34846, 34752, 34656, 34560, 34468, 34374, 34280, 34186, 34094,
    34000, 33906, 33816, 33724, 33630, 33540, 33448, 33356, 33266, 33174, 33082,
    32994, 32902, 32812
};

/* |v| < 8, so the square of its 17 bits is below 2^32; q_line is below 2^27.
 * The pixels below the cut follow one another, since v grows with i. */
static void blend_line(uint32_t *t, uint32_t plane, const span *s,
                       const saga_patch *p)
{
    uint32_t v = (uint32_t)s->v + 0x4000u;
    int32_t i;
    int any = 0;

    t += s->lo;
    for (i = s->lo; i < s->hi; i++, v += (uint32_t)p->g, t++) {
        const uint32_t v13 = (uint32_t)((int32_t)v >> 15);
        const uint32_t q = (uint32_t)s->q_line + ((v13 * v13 + 32) >> 6);
        uint32_t w;

        if (q >= SAGA_CUT_Q20) {
            if (any)
                return;
            continue;
        }
        any = 1;
        if (*t < SAGA_T_FLOOR_Q16)
            continue;
        w = exp2_neg_q16[q >> 12 & 255] >> (q >> 20);
        w = (w < SAGA_ALPHA_CAP_Q16 ? w : SAGA_ALPHA_CAP_Q16) * *t >> 16;
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
        s.q_line = p->q0 + (int32_t)((w13 * w13 + 32) >> 6);
        if (s.q_line < SAGA_CUT_Q20)
            blend_line(t, side * side, &s, p);
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

/* Finds where |v + g i| < L for i in x0..x1-1, L = sqrt(8 - q_line) rounded
 * up: -L - v < g i < L - v. A bound outside 0..x1 g needs no division; inside,
 * it is below 2^35, times the reciprocal below 2^52, and the quotient, at most
 * 64, is off by less than 2^-8. So [lo, hi) misses no pixel, and reaches no
 * further than 1 + 2^-8 pixels beyond L: |v| <= 2.83 + 1.56 = 4.39 < 8 fits
 * Q28. Returns 0 where no pixel can pass. */
static int find_span(span *s, const line *l, const saga_patch *p)
{
    const int64_t reach = (int64_t)p->g * p->x1;
    int64_t limit, first, last;
    int32_t w13;

    if (l->w >= LIMIT_W || l->w <= -LIMIT_W)
        return 0;
    w13 = fx_rshift((int32_t)l->w, 15);
    s->q_line = p->q0 + fx_rshift(w13 * w13, 6);
    if (s->q_line >= SAGA_CUT_Q20)
        return 0;
    limit = (int64_t)sqrt_up_q20_q12(SAGA_CUT_Q20 - s->q_line) << 16;
    first = -limit - l->v;
    last = limit - l->v;
    if (last <= 0 || (first >= reach && first >= 0))
        return 0;
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
    switch (cpu) {
#ifdef SAGA_MAY_AVX2
    case SAGA_CPU_AVX2:
        saga_blend__avx2(t, side, p);
        break;
#endif
#ifdef SAGA_MAY_X4
    case SAGA_CPU_X4:
        saga_blend__x4(t, side, p);
        break;
#endif
    default:
        blend_tame(t, side, p);
    }
}

void saga_blend(uint32_t *t, uint32_t side, const saga_patch *p, saga_cpu cpu)
{
    if (is_tame(p))
        blend_small(t, side, p, cpu);
    else
        blend_wild(t, side, p);
}
