/* SPDX-License-Identifier: MIT
 *
 * Blending; docs/arithmetic.md has the norm. What a pixel is depends on
 * nothing but the splats' order:
 *
 *     for each splat, front to back:
 *         if T < 8 or q >= 8: next
 *         alpha = min(2^-q, cap); w = alpha T >> 16; T -= w; C += w colour
 *
 * The rest of this file is about doing that for many pixels at a time. The
 * job's rectangle is cut into tiles, tiles are grouped into bands: as many
 * columns as the scratch holds, and once all columns fit, as many rows. For
 * each band the splats are looked at once, in order, and listed with each tile
 * they may touch; when the list is full, and at the end, each tile blends its
 * splats and the list starts anew. A tile in which every pixel is finished
 * (T < 8) is neither listed for nor blended again: that follows from the rule
 * per pixel and cannot show.
 *
 * Scratch: a struct state in the first 256 bytes; a struct queue per tile of
 * the band; the list; and for each tile four planes T, R, G, B of uint32. All
 * progress is in struct state, so that a call may stop after any unit of work.
 *
 * cursor[0]: 0 not begun, 1 begun (struct state is valid), 2 finished. The
 * others belong to the caller, who keeps a job with its view.
 */
#include "raster.h"

#include "fx.h"
#include "fx_math.h"
#include "model.h"
#include "sqrt_up.h"

#define CUT_Q20 (SAGA_CUT_LOG2 << 20)
#define LIMIT_W ((int64_t)3 << 28)   /* w^2 >= 9: beyond the cut */
#define NONE 0xffffffffu             /* end of a queue */
#define CLOSED 0xfffffffeu           /* head of a finished tile's queue */
#define CHECK_EVERY 32               /* splats between looks for a finished
                                      * tile */
enum { STATE_NBYTES = 256, N_PLANES = 4 };
enum { CURSOR_NEW, CURSOR_BEGUN, CURSOR_FINISHED };
enum { STEP_CLEAR, STEP_LIST, STEP_BLEND, STEP_WRITE };

/* Where the job stands. Tiles are counted from the job's corner in col and
 * row, from the band's in tx and ty. */
typedef struct {
    uint32_t step;
    uint32_t band_cols, band_rows;  /* largest band, in tiles */
    uint32_t col, row;              /* first tile of this band */
    uint32_t tx, ty;                /* tile at work */
    uint32_t line;                  /* next line of the tile (STEP_BLEND: of
                                     * the splat in it) */
    uint32_t next;                  /* next splat in drawing order */
    uint32_t part;                  /* ... is listed with its tiles before */
    uint32_t part_x, part_y;        /* this one */
    uint32_t used;                  /* entries of the list */
    uint32_t count;                 /* splats blended in this tile */
} state;

_Static_assert(sizeof(state) <= STATE_NBYTES, "SAGA_JOB_NBYTES");

/* The splats listed for one tile, a chain of entries. */
typedef struct {
    uint32_t head, tail;
} queue;

typedef struct {
    uint32_t splat;
    uint32_t next;
} entry;

_Static_assert(sizeof(queue) == 8 && sizeof(entry) == 8, "SAGA_JOB_NBYTES");

/* One call. */
typedef struct {
    const saga_job *job;
    const saga_picture *pic;
    const saga_camera *cam;
    const saga_splat *splats;
    const saga_key *order;
    uint32_t n;
    uint32_t budget;
    uint32_t side, log2_side;       /* of a tile, pixels */
    uint32_t cols, rows;            /* of the job, tiles */
    uint32_t nx, ny;                /* of this band, tiles */
    state *s;
    queue *queues;
    entry *list;
    uint32_t *pixels;               /* planes of the band's first tile */
} raster;

/* --- The splat on a line of pixels --------------------------------------- */

/* A splat in a tile, at the line being blended. */
typedef struct {
    int64_t v, w;                   /* Q28, at the centre of the line's first
                                     * pixel */
    int32_t g, n, h;                /* Q28: steps of v to the right, of v
                                     * upwards, of w downwards */
    int32_t q0;                     /* Q20 */
    uint32_t recip;                 /* 1/g = recip * 2^-shift */
    int shift;
    uint32_t colour[3];
} brush;

/* The pixels [lo, hi) of a line where q < 8 is possible; q_line = q0 + w^2. */
typedef struct {
    int32_t v;                      /* Q28, at lo; exact for lo..hi-1 */
    int32_t g;
    int32_t q_line;
    int32_t lo, hi;
} span;

/* dx, dy from the mean to the centre of pixel (x, y), Q8, below 2^24: products
 * below 2^53. */
static void brush_init(brush *b, const saga_splat *s, int32_t x, int32_t y)
{
    const int64_t dx = x * 256 + 128 - s->mean_q8[0];
    const int64_t dy = y * 256 + 128 - s->mean_q8[1];
    int i;

    b->g = s->chol_q28[0];
    b->n = s->chol_q28[1];
    b->h = s->chol_q28[2];
    b->q0 = s->q0_q20;
    b->v = fx_rshift64(b->g * dx - b->n * dy, 8);
    b->w = fx_rshift64(b->h * dy, 8);
    b->recip = saga_recip16((uint32_t)fx_max(b->g, 1), &b->shift);
    for (i = 0; i < 3; i++)
        b->colour[i] = s->colour_q15[i];
}

/* One line down: dy grows by 256, so these steps are exact. */
static void brush_step(brush *b)
{
    b->v -= b->n;
    b->w += b->h;
}

/* Finds where |v + g i| < L for i in 0..width-1, L = sqrt(8 - q_line) rounded
 * up: -L - v < g i < L - v. A bound outside 0..width g needs no division;
 * inside, it is below 2^35, times the reciprocal below 2^52, and the quotient,
 * at most 64, is off by less than 2^-8. So [lo, hi) misses no pixel, and
 * reaches no further than 1 + 2^-8 pixels beyond L: |v| <= 2.83 + 1.56 =
 * 4.39 < 8 fits Q28. Returns 0 where no pixel can pass. */
static int find_span(span *s, const brush *b, int32_t width)
{
    const int64_t reach = (int64_t)b->g * width;
    int64_t l, first, last;
    int32_t w13;

    if (b->w >= LIMIT_W || b->w <= -LIMIT_W)
        return 0;
    w13 = fx_rshift((int32_t)b->w, 15);
    s->q_line = b->q0 + fx_rshift(w13 * w13, 6);
    if (s->q_line >= CUT_Q20)
        return 0;
    l = (int64_t)sqrt_up_q20_q12(CUT_Q20 - s->q_line) << 16;
    first = -l - b->v;
    last = l - b->v;
    if (last <= 0 || (first >= reach && first >= 0))
        return 0;
    s->lo = first <= 0 ? 0 : (int32_t)(first * b->recip >> b->shift);
    s->hi = last >= reach ? width
          : fx_min((int32_t)(last * b->recip >> b->shift) + 2, width);
    s->v = (int32_t)(b->v + (int64_t)b->g * s->lo);
    s->g = b->g;
    return s->lo < s->hi;
}

#if defined(__AVX2__) || defined(__ARM_NEON)

/* Eight pixels at a time, written for the compiler's vectoriser: whole groups
 * of the tile's line, in which the pixels outside [lo, hi) are masked out
 * (their v may have wrapped around). 2^-f is a polynomial in the fraction of q
 * rounded to 8 bits, f Q15 in 64..32704:
 *     2^-f ~ 1 - f (22706 - f (7775 - 1453 f)), in Q15, truncated,
 * by construction the same integers as the table below. */
static void blend_group(uint32_t *restrict t, uint32_t *restrict r,
                        uint32_t *restrict g, uint32_t *restrict b,
                        const span *restrict s, const uint32_t *restrict colour)
{
    const uint32_t step = (uint32_t)s->g;
    const uint32_t v0 = (uint32_t)s->v + 0x4000u;
    const int32_t lo = s->lo, hi = s->hi, q_line = s->q_line;
    const uint32_t cr = colour[0], cg = colour[1], cb = colour[2];
    int32_t i;

    for (i = 0; i < 8; i++) {
        const int32_t v13 = (int32_t)(v0 + step * (uint32_t)i) >> 15;
        const uint32_t v2 = (uint32_t)v13 * (uint32_t)v13;
        const int32_t q = q_line + (int32_t)((v2 + 32) >> 6);
        const uint32_t f = ((uint32_t)q >> 5 & 0x7f80u) | 64u;
        const uint32_t p2 = 7775u - (f * 1453u >> 15);
        const uint32_t p1 = 22706u - (f * p2 >> 15);
        const uint32_t m = (32767u - (f * p1 >> 15)) << 1;
        const uint32_t a = m >> ((uint32_t)q >> 20 & 31u);
        const uint32_t cap = a < SAGA_ALPHA_CAP_Q16 ? a : SAGA_ALPHA_CAP_Q16;
        const uint32_t ti = t[i];
        const int pass = (q < CUT_Q20) & (ti >= SAGA_T_FLOOR_Q16) &
                         (i >= lo) & (i < hi);
        const uint32_t w = pass ? cap * ti >> 16 : 0;

        t[i] = ti - w;
        r[i] += w * cr;
        g[i] += w * cg;
        b[i] += w * cb;
    }
}

/* v at the first pixel of the first group, modulo 2^32. */
static void blend_line(uint32_t *t, uint32_t plane, span *s,
                       const uint32_t *colour)
{
    const int32_t first = s->lo & ~7;
    int32_t i;

    s->v = (int32_t)((uint32_t)s->v -
                     (uint32_t)s->g * (uint32_t)(s->lo - first));
    s->lo -= first;
    s->hi -= first;
    t += first;
    for (i = s->hi; i > 0; i -= 8) {
        blend_group(t, t + plane, t + 2 * plane, t + 3 * plane, s, colour);
        s->v = (int32_t)((uint32_t)s->v + 8 * (uint32_t)s->g);
        s->lo -= 8;
        s->hi -= 8;
        t += 8;
    }
}

#else

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

/* |v13| <= 4.39 * 2^13: its square is below 2^31. */
static void blend_line(uint32_t *t, uint32_t plane, span *s,
                       const uint32_t *colour)
{
    int32_t v = s->v;
    int32_t i;

    t += s->lo;
    for (i = s->lo; i < s->hi; i++, v += s->g, t++) {
        const int32_t v13 = (v + 0x4000) >> 15;
        const uint32_t q = (uint32_t)s->q_line +
                           (((uint32_t)(v13 * v13) + 32) >> 6);
        uint32_t w;

        if (q >= CUT_Q20 || *t < SAGA_T_FLOOR_Q16)
            continue;
        w = exp2_neg_q16[q >> 12 & 255] >> (q >> 20);
        w = (w < SAGA_ALPHA_CAP_Q16 ? w : SAGA_ALPHA_CAP_Q16) * *t >> 16;
        *t -= w;
        t[plane] += w * colour[0];
        t[2 * plane] += w * colour[1];
        t[3 * plane] += w * colour[2];
    }
}

#endif

/* --- Tiles --------------------------------------------------------------- */

static uint32_t spend(raster *r, uint32_t wanted)
{
    const uint32_t n = wanted < r->budget ? wanted : r->budget;

    r->budget -= n;
    return n;
}

static uint32_t *tile_pixels(const raster *r, uint32_t tx, uint32_t ty)
{
    return r->pixels + ((size_t)(ty * r->nx + tx) << 2 * r->log2_side) *
                       N_PLANES;
}

static queue *tile_queue(const raster *r, uint32_t tx, uint32_t ty)
{
    return r->queues + (ty * r->nx + tx);
}

/* The picture's coordinates of a tile of the band. */
static int32_t tile_x(const raster *r, uint32_t tx)
{
    return r->job->x0 + (int32_t)((r->s->col + tx) << r->log2_side);
}

static int32_t tile_y(const raster *r, uint32_t ty)
{
    return r->job->y0 + (int32_t)((r->s->row + ty) << r->log2_side);
}

/* Next tile of the band, in rows; 0 after the last, with tx = ty = 0. */
static int next_tile(raster *r)
{
    state *const s = r->s;

    s->line = 0;
    s->count = 0;
    if (++s->tx < r->nx)
        return 1;
    s->tx = 0;
    if (++s->ty < r->ny)
        return 1;
    s->ty = 0;
    return 0;
}

/* Every T below the floor, which is a power of two. */
static int is_finished(const uint32_t *t, uint32_t n)
{
    uint32_t any = 0;
    uint32_t i;

    for (i = 0; i < n; i++)
        any |= t[i];
    return any < SAGA_T_FLOOR_Q16;
}

_Static_assert((SAGA_T_FLOOR_Q16 & (SAGA_T_FLOOR_Q16 - 1)) == 0, "is_finished");

/* T = 1 and C = 0, one line of a tile per unit. Pixels of the tile outside the
 * job's rectangle are finished from the start. */
static void clear_lines(raster *r, uint32_t *t, int32_t x, int32_t y)
{
    const uint32_t plane = 1u << 2 * r->log2_side;
    const uint32_t n = spend(r, r->side - r->s->line);
    uint32_t i, k;

    for (k = 0; k < n; k++, r->s->line++) {
        uint32_t *const p = t + (r->s->line << r->log2_side);
        const int inside = y + (int32_t)r->s->line < r->job->y1;

        for (i = 0; i < r->side; i++) {
            p[i] = inside && x + (int32_t)i < r->job->x1 ? 65536 : 0;
            p[i + plane] = 0;
            p[i + 2 * plane] = 0;
            p[i + 3 * plane] = 0;
        }
    }
}

static void step_clear(raster *r)
{
    state *const s = r->s;
    queue *const q = tile_queue(r, s->tx, s->ty);

    q->head = NONE;
    clear_lines(r, tile_pixels(r, s->tx, s->ty), tile_x(r, s->tx),
                tile_y(r, s->ty));
    if (s->line < r->side || next_tile(r))
        return;
    s->step = STEP_LIST;
    s->next = 0;
    s->used = 0;
    s->part = 0;
}

/* --- Listing ------------------------------------------------------------- */

/* The tiles of the band a splat's box touches, inclusive. */
typedef struct {
    uint32_t x0, y0, x1, y1;
} tile_range;

static int splat_tiles(tile_range *t, const raster *r, const saga_splat *s)
{
    const int32_t x = tile_x(r, 0), y = tile_y(r, 0);
    const int32_t x1 = fx_min(s->x1, fx_min(tile_x(r, r->nx), r->job->x1));
    const int32_t y1 = fx_min(s->y1, fx_min(tile_y(r, r->ny), r->job->y1));
    const int32_t x0 = fx_max(s->x0, x);
    const int32_t y0 = fx_max(s->y0, y);

    if (x0 >= x1 || y0 >= y1)
        return 0;
    t->x0 = (uint32_t)(x0 - x) >> r->log2_side;
    t->y0 = (uint32_t)(y0 - y) >> r->log2_side;
    t->x1 = (uint32_t)(x1 - 1 - x) >> r->log2_side;
    t->y1 = (uint32_t)(y1 - 1 - y) >> r->log2_side;
    return 1;
}

static void append(raster *r, queue *q, uint32_t splat)
{
    const uint32_t i = r->s->used++;

    r->list[i].splat = splat;
    r->list[i].next = NONE;
    if (q->head == NONE)
        q->head = i;
    else
        r->list[q->tail].next = i;
    q->tail = i;
}

/* Lists a splat with its tiles from (part_x, part_y) on, one unit each.
 * Returns 0 when interrupted by the budget or by the list's end. */
static int list_tiles(raster *r, const tile_range *t, uint32_t splat)
{
    state *const s = r->s;

    while (s->part_y <= t->y1) {
        queue *const q = tile_queue(r, s->part_x, s->part_y);

        if (r->budget == 0 ||
            (q->head != CLOSED && s->used == r->job->list_capacity))
            return 0;
        r->budget--;
        if (q->head != CLOSED)
            append(r, q, splat);
        if (s->part_x++ == t->x1) {
            s->part_x = t->x0;
            s->part_y++;
        }
    }
    return 1;
}

/* Looks at splat s->next: one unit. */
static int list_splat(raster *r, uint32_t splat)
{
    state *const s = r->s;
    tile_range t;

    if (!splat_tiles(&t, r, r->splats + splat)) {
        r->budget--;
        return 1;
    }
    if (!s->part) {
        s->part = 1;
        s->part_x = t.x0;
        s->part_y = t.y0;
        r->budget--;
    }
    if (!list_tiles(r, &t, splat))
        return 0;
    s->part = 0;
    return 1;
}

static void step_list(raster *r)
{
    state *const s = r->s;

    while (r->budget > 0 && s->next < r->n) {
        if (!list_splat(r, r->order[s->next].index))
            break;
        s->next++;
    }
    if (r->budget > 0)
        s->step = STEP_BLEND;
}

/* --- Blending ------------------------------------------------------------ */

/* Blends a splat into the tile at work, one unit per line. Returns 0 when the
 * budget ends before it is through. */
static int blend_splat(raster *r, const saga_splat *splat)
{
    state *const s = r->s;
    const int32_t x = tile_x(r, s->tx), y = tile_y(r, s->ty);
    const int32_t width = fx_min((int32_t)r->side, r->job->x1 - x);
    const int32_t y0 = fx_max(splat->y0, y);
    const int32_t y1 = fx_min(splat->y1, fx_min(y + (int32_t)r->side,
                                                r->job->y1));
    const uint32_t end = (uint32_t)(y1 - y0);
    uint32_t *t = tile_pixels(r, s->tx, s->ty);
    uint32_t n = spend(r, end - s->line);
    brush b;
    span p;

    brush_init(&b, splat, x, y0 + (int32_t)s->line);
    t += ((uint32_t)(y0 - y) + s->line) << r->log2_side;
    s->line += n;
    for (; n > 0; n--) {
        if (find_span(&p, &b, width))
            blend_line(t, 1u << 2 * r->log2_side, &p, b.colour);
        brush_step(&b);
        t += r->side;
    }
    if (s->line < end)
        return 0;
    s->line = 0;
    return 1;
}

/* The tile at work: its queue, then one unit for the tile. */
static void step_blend(raster *r)
{
    state *const s = r->s;
    queue *const q = tile_queue(r, s->tx, s->ty);

    while (q->head < CLOSED) {
        const entry *const e = r->list + q->head;

        if (!blend_splat(r, r->splats + e->splat))
            return;
        q->head = e->next;
        if ((++s->count % CHECK_EVERY == 0 || q->head == NONE) &&
            is_finished(tile_pixels(r, s->tx, s->ty), 1u << 2 * r->log2_side))
            q->head = CLOSED;
    }
    if (r->budget == 0)
        return;
    r->budget--;
    if (next_tile(r))
        return;
    s->used = 0;
    s->step = s->next < r->n ? STEP_LIST : STEP_WRITE;
}

/* Places the band's arrays behind one another; see the head of this file. */
static void lay_out_band(raster *r)
{
    const state *const s = r->s;

    r->nx = s->band_cols < r->cols - s->col ? s->band_cols : r->cols - s->col;
    r->ny = s->band_rows < r->rows - s->row ? s->band_rows : r->rows - s->row;
    r->list = (entry *)(r->queues + (size_t)r->nx * r->ny);
    r->pixels = (uint32_t *)(r->list + r->job->list_capacity);
}

/* Returns 1 after the last band. */
static int next_band(raster *r)
{
    state *const s = r->s;

    s->step = STEP_CLEAR;
    s->col += s->band_cols;
    if (s->col >= r->cols) {
        s->col = 0;
        s->row += s->band_rows;
    }
    if (s->row >= r->rows)
        return 1;
    lay_out_band(r);
    return 0;
}

/* --- Output -------------------------------------------------------------- */

/* C + T background <= 2^16 * 2^15 in Q31, since all weights and the last T sum
 * to 65536; scaled to 0..max and rounded. */
static uint32_t finish(uint32_t c, uint32_t t, uint32_t background,
                       uint32_t max)
{
    const uint64_t sum = (uint64_t)c + (uint64_t)t * background;
    const uint32_t v = (uint32_t)((sum * max + (1u << 30)) >> 31);

    return v < max ? v : max;
}

static void write_line(const raster *r, const uint32_t *t, int32_t x,
                       int32_t y)
{
    const uint32_t plane = 1u << 2 * r->log2_side;
    const int32_t width = fx_min((int32_t)r->side, r->job->x1 - x);
    const int is_16 = r->pic->bits == 16;
    /* The picture begins at the job's corner: a band's buffer suffices. */
    void *const line = (uint8_t *)r->pic->rgb +
                       (size_t)(y - r->job->y0) * r->pic->stride_nbytes;
    uint8_t *const p8 = (uint8_t *)line + 3 * (x - r->job->x0);
    uint16_t *const p16 = (uint16_t *)line + 3 * (x - r->job->x0);
    int32_t i, k;

    for (i = 0; i < width; i++)
        for (k = 0; k < 3; k++) {
            const uint32_t sum = t[(uint32_t)i + plane * (uint32_t)(k + 1)];
            const uint32_t v = finish(sum, t[i], r->cam->background_q15[k],
                                      is_16 ? 65535 : 255);

            if (is_16)
                p16[3 * i + k] = (uint16_t)v;
            else
                p8[3 * i + k] = (uint8_t)v;
        }
}

/* One unit per line. Returns 1 when the last band is written. */
static int step_write(raster *r)
{
    state *const s = r->s;
    const int32_t x = tile_x(r, s->tx), y = tile_y(r, s->ty);
    const uint32_t n = spend(r, r->side - s->line);
    const uint32_t *t = tile_pixels(r, s->tx, s->ty);
    uint32_t k;

    for (k = 0; k < n; k++, s->line++)
        if (y + (int32_t)s->line < r->job->y1)
            write_line(r, t + (s->line << r->log2_side), x,
                       y + (int32_t)s->line);
    if (s->line < r->side || next_tile(r))
        return 0;
    return next_band(r);
}

/* --- The job ------------------------------------------------------------- */

/* Tiles that fit n_bytes, at most all of them. Their pixels alone bound the
 * number by n; the queues then take 8 bytes in 2^shift of each. */
static uint32_t count_tiles(size_t n_bytes, uint32_t log2_side, uint32_t all)
{
    const uint32_t shift = 2 * log2_side + 4;
    const size_t each = ((size_t)1 << shift) + sizeof(queue);
    size_t n = n_bytes >> shift;

    if (n > all)
        n = all;
    n -= n * sizeof(queue) >> shift;
    while (n * each > n_bytes)
        n--;
    return (uint32_t)n;
}

/* The largest band: a part of a row of tiles, or as many full rows as fit. */
static void begin(raster *r, uint32_t n_tiles)
{
    state *const s = r->s;

    s->step = STEP_CLEAR;
    s->band_cols = n_tiles < r->cols ? n_tiles : r->cols;
    s->band_rows = 1;
    while (s->band_rows < r->rows && (s->band_rows + 1) * r->cols <= n_tiles)
        s->band_rows++;
    s->col = 0;
    s->row = 0;
    s->tx = 0;
    s->ty = 0;
    s->line = 0;
    s->part = 0;
}

static uint32_t log2_of_side(int32_t tile)
{
    return tile == 8 ? 3 : tile == 16 ? 4 : tile == 32 ? 5 : tile == 64 ? 6 : 0;
}

/* Bytes of scratch left for tiles after state and list; 0 when too small. */
static size_t tile_nbytes(const saga_job *job)
{
    const size_t capacity = job->list_capacity;

    if (job->scratch_nbytes < STATE_NBYTES ||
        capacity > (job->scratch_nbytes - STATE_NBYTES) / sizeof(entry))
        return 0;
    return job->scratch_nbytes - STATE_NBYTES - capacity * sizeof(entry);
}

static int is_inside(const saga_job *job, const saga_camera *cam)
{
    return job->x0 >= 0 && job->y0 >= 0 && job->x0 < job->x1 &&
           job->y0 < job->y1 && job->x1 <= cam->width &&
           job->y1 <= cam->height;
}

/* Rows that overlap are refused with the sizes: width < 2^14.1 and height
 * <= 2^14, so that a stride of 2^48 is far beyond any capacity. */
static saga_status check_picture(const saga_picture *pic,
                                 const saga_job *job)
{
    const uint32_t width = (uint32_t)(job->x1 - job->x0);
    const uint32_t height = (uint32_t)(job->y1 - job->y0);
    const uint64_t line = (uint64_t)width * 3 * (pic->bits == 16 ? 2 : 1);
    const uint64_t stride = pic->stride_nbytes;

    if (height > 1 && stride < line)
        return SAGA_ERR_ARG;
    if (stride >> 48 || line + stride * (height - 1u) > pic->nbytes)
        return SAGA_ERR_SPACE;
    if (pic->bits == 16 && (((uintptr_t)pic->rgb | pic->stride_nbytes) & 1))
        return SAGA_ERR_ALIGN;
    return SAGA_OK;
}

static saga_status check(const saga_job *job, const saga_picture *pic,
                         const saga_camera *cam)
{
    const uint32_t log2_side = log2_of_side(job->tile);

    if (log2_side == 0 || job->list_capacity == 0 || !is_inside(job, cam) ||
        (pic->bits != 8 && pic->bits != 16))
        return SAGA_ERR_ARG;
    if (count_tiles(tile_nbytes(job), log2_side, 1) == 0)
        return SAGA_ERR_SPACE;
    if ((uintptr_t)job->scratch & 3)
        return SAGA_ERR_ALIGN;
    return check_picture(pic, job);
}

static void open_job(raster *r, saga_job *job)
{
    r->job = job;
    r->log2_side = log2_of_side(job->tile);
    r->side = 1u << r->log2_side;
    r->cols = ((uint32_t)(job->x1 - job->x0) + r->side - 1) >> r->log2_side;
    r->rows = ((uint32_t)(job->y1 - job->y0) + r->side - 1) >> r->log2_side;
    r->s = job->scratch;
    r->queues = (queue *)((uint32_t *)job->scratch + STATE_NBYTES / 4);
    if (job->cursor[0] == CURSOR_NEW)
        begin(r, count_tiles(tile_nbytes(job), r->log2_side,
                             r->cols * r->rows));
    job->cursor[0] = CURSOR_BEGUN;
    lay_out_band(r);
}

/* Returns 1 when the job is finished, 0 when the budget is spent. */
static int work(raster *r)
{
    while (r->budget > 0) {
        if (r->s->step == STEP_BLEND)
            step_blend(r);
        else if (r->s->step == STEP_LIST)
            step_list(r);
        else if (r->s->step == STEP_CLEAR)
            step_clear(r);
        else if (step_write(r))
            return 1;
    }
    return 0;
}

saga_status saga_raster(saga_job *job, const saga_picture *pic,
                        const saga_camera *cam, const saga_splat *splats,
                        const saga_key *order, uint32_t n, uint32_t budget)
{
    const saga_status status = check(job, pic, cam);
    raster r;

    if (status != SAGA_OK || job->cursor[0] == CURSOR_FINISHED)
        return status;
    r.pic = pic;
    r.cam = cam;
    r.splats = splats;
    r.order = order;
    r.n = n;
    r.budget = budget;
    open_job(&r, job);
    if (!work(&r))
        return SAGA_AGAIN;
    job->cursor[0] = CURSOR_FINISHED;
    return SAGA_OK;
}
