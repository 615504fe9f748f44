/* SPDX-License-Identifier: MIT
 *
 * Blending; docs/arithmetic.md is normative. The value of a pixel depends only
 * on the order of the splats:
 *
 *     for each splat, front to back:
 *         if T < 8 or q >= 11: next
 *         alpha = min(2^(3 - q), cap); w = alpha T; T -= w; C += w colour
 *
 * This file does so for many pixels at a time. The job's rectangle is divided
 * into tiles, and the tiles are grouped into bands: as many columns as the
 * scratch has room for and, if it has room for all columns, as many rows. For
 * each band, the splats are visited once, in order, and entered in a list for
 * each tile that they may touch. When the list is full, and at the end, each
 * tile blends its splats, and the list is emptied. A tile in which every pixel
 * is finished (T < 8) gets no further entries; by the rule above, this does not
 * change its pixels.
 *
 * If one list is enough for a band, its tiles are processed one after another,
 * from clearing to writing, all in the pixel memory of the first tile, which
 * stays in the cache. If a row of tiles has several bands, half of the list
 * stores the keys of splats that touch the row, as many as fit, so that the
 * later bands need not visit every splat.
 *
 * The scratch contains a raster_state in the first 256 bytes; four planes T, R,
 * G, B of uint32 for each tile of the band; a raster_queue for each tile; the
 * list. All progress is in raster_state, so that a call may stop after any unit
 * of work.
 *
 * cursor[0] is 0 before the job begins, 1 while it is in progress (raster_state
 * is valid), and 2 when it is finished. draw.c uses the other elements.
 */
#include "blend.h"
#include "fx.h"
#include "raster_state.h"
#include "sqrt_up.h"

/* Prefetch the splat that comes this number of splats later. */
#define AHEAD 4
/* Splats between tests whether a tile is finished. */
#define CHECK_EVERY 32

/* --- Tiles --------------------------------------------------------------- */

static uint32_t spend(raster *r, uint32_t wanted)
{
    const uint32_t n = wanted < r->budget ? wanted : r->budget;

    r->budget -= n;
    return n;
}

/* Returns the number of keys to visit for this band. */
static uint32_t n_keys(const raster *r)
{
    return r->s->n_kept + (r->n - r->s->n_passed);
}

static int is_last_list(const raster *r)
{
    return r->s->counted.key == n_keys(r);
}

static uint32_t *tile_pixels(const raster *r, uint32_t tx, uint32_t ty)
{
    if (r->s->is_first && is_last_list(r))
        return r->pixels;
    return r->pixels +
           ((size_t)(ty * r->nx + tx) << 2 * r->log2_side) * N_PLANES;
}

/* Moves to the next tile of the band, row by row. After the last tile returns 0
 * and sets tx = ty = 0. */
static int next_tile(raster *r)
{
    raster_state *const s = r->s;

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

/* Returns whether every T is below the floor, which is a power of two. */
static int is_finished(const uint32_t *t, uint32_t n)
{
    uint32_t any = 0;
    uint32_t i;

    for (i = 0; i < n; i++)
        any |= t[i];
    return any < SAGA_T_FLOOR_Q16;
}

_Static_assert((SAGA_T_FLOOR_Q16 & (SAGA_T_FLOOR_Q16 - 1)) == 0, "is_finished");

/* Sets T = 1 and C = 0, one line of a tile per unit. Pixels of the tile outside
 * the job's rectangle start as finished. */
static void step_clear(raster *r)
{
    raster_state *const s = r->s;
    const int32_t x = tile_x(r, s->tx), y = tile_y(r, s->ty);
    const uint32_t plane = 1u << 2 * r->log2_side;
    const uint32_t n = spend(r, r->side - s->line);
    uint32_t *const t = tile_pixels(r, s->tx, s->ty);
    uint32_t i, k;

    for (k = 0; k < n; k++, s->line++) {
        uint32_t *const p = t + (s->line << r->log2_side);
        const int inside = y + (int32_t)s->line < r->job->y1;

        for (i = 0; i < r->side; i++) {
            p[i] = inside && x + (int32_t)i < r->job->x1 ? 65536 : 0;
            p[i + plane] = 0;
            p[i + 2 * plane] = 0;
            p[i + 3 * plane] = 0;
        }
    }
    if (s->line < r->side)
        return;
    s->line = 0;
    s->step = STEP_BLEND;
}

/* Begins the next list with the key at which the previous list ended. */
static void begin_list(raster_state *s)
{
    s->listed = s->counted;
    s->n_counted = 0;
    s->n_listed = 0;
}

/* Opens the queues of all tiles, one tile per unit. */
static void step_open(raster *r)
{
    raster_state *const s = r->s;
    const uint32_t n = r->nx * r->ny;

    for (; r->budget > 0 && s->tx < n; r->budget--)
        r->queues[s->tx++].n = 0;
    if (s->tx < n)
        return;
    s->tx = 0;
    s->step = STEP_KEEP;
    s->counted.key = 0;
    s->counted.is_begun = 0;
    s->is_first = 1;
    begin_list(s);
}

/* --- Blending ------------------------------------------------------------ */

/* Goes on to the next tile, or after the last tile to the next list. */
static void leave_tile(raster *r)
{
    raster_state *const s = r->s;

    s->step = s->is_first ? STEP_CLEAR : STEP_BLEND;
    if (next_tile(r))
        return;
    /* All tiles have blended this list; the next begins where it was full. */
    begin_list(s);
    s->is_first = 0;
    s->step = STEP_COUNT;
}

/* Sets v and w from dx, dy, the distance from the mean to the centre of pixel
 * (x, y). In Q8 these are below 2^24, so that products are below 2^53. */
static void begin_patch(saga_patch *p, const saga_splat *s, int32_t x,
                        int32_t y, uint32_t tools)
{
    const int64_t dx = x * 256 + 128 - s->mean_q8[0];
    const int64_t dy = y * 256 + 128 - s->mean_q8[1];

    p->g = s->chol_q28[0];
    p->n = s->chol_q28[1];
    p->h = s->chol_q28[2];
    p->q0 = s->q0_q20;
    p->tools = tools;
    p->reach = saga_reach_q20(SAGA_CUT_Q20 - s->q0_q20, tools);
    p->v = fx_rshift64(p->g * dx - p->n * dy, 8);
    p->w = fx_rshift64(p->h * dy, 8);
}

/* Sets the colours. For depth pictures, the 32 bits of a depth are blended as
 * three colours of 10, 11 and 11 bits, whose sums are at most 2^16 (2^11 - 1).
 */
static void colour_patch(saga_patch *p, const saga_splat *s, int bits)
{
    if (bits == SAGA_DEPTH) {
        p->colour_q15[0] = (uint16_t)(s->depth >> 22);
        p->colour_q15[1] = s->depth >> 11 & 2047;
        p->colour_q15[2] = s->depth & 2047;
    } else {
        p->colour_q15[0] = s->colour_q15[0];
        p->colour_q15[1] = s->colour_q15[1];
        p->colour_q15[2] = s->colour_q15[2];
    }
}

/* Blends a splat into the current tile, one line per unit. Returns 0 if the
 * budget is used up before the last line. */
static int blend_splat(raster *r, const saga_splat *splat)
{
    raster_state *const s = r->s;
    const int32_t x = tile_x(r, s->tx), y = tile_y(r, s->ty);
    const int32_t right = fx_min(x + (int32_t)r->side, r->job->x1);
    const int32_t bottom = fx_min(y + (int32_t)r->side, r->job->y1);
    const int32_t y0 = fx_max(splat->y0, y);
    const int32_t height = fx_min(splat->y1, bottom) - y0;
    const uint32_t end = (uint32_t)fx_max(height, 0);
    const uint32_t first = (uint32_t)(y0 - y) + s->line;
    uint32_t *const t = tile_pixels(r, s->tx, s->ty);
    saga_patch p;

    p.x0 = fx_max(splat->x0, x) - x;
    p.x1 = fx_min(splat->x1, right) - x;
    if (p.x0 >= p.x1)
        return 1;
    begin_patch(&p, splat, x, y + (int32_t)first, r->tools);
    colour_patch(&p, splat, r->pic->bits);
    /* Lines that exceed the budget are blended by the next call. */
    p.n_rows = spend(r, end - s->line);
    s->line += p.n_rows;
    if (p.n_rows > 0)
        saga_blend(t + (first << r->log2_side), r->side, &p, r->cpu);
    if (s->line < end)
        return 0;
    s->line = 0;
    return 1;
}

/* Prefetches a splat. Splats are stored in the order of their primitives, so
 * that in drawing order they are scattered in memory. */
static void fetch(const saga_splat *s)
{
    __builtin_prefetch(s);
    __builtin_prefetch((const uint8_t *)(s + 1) - 1);
}

/* Blends the queue of the current tile, then spends one unit for the tile. */
static void step_blend(raster *r)
{
    raster_state *const s = r->s;
    raster_queue *const q = tile_queue(r, s->tx, s->ty);

    while (q->n != 0 && q->n != CLOSED) {
        if (q->n > AHEAD)
            fetch(r->splats + r->list[q->first + AHEAD]);
        if (!blend_splat(r, r->splats + r->list[q->first]))
            return;
        q->first++;
        q->n--;
        /* Testing all pixels takes as long as a few splats, so that it is not
         * done after each splat. */
        if ((++s->count % CHECK_EVERY == 0 || q->n == 0) &&
            is_finished(tile_pixels(r, s->tx, s->ty), 1u << 2 * r->log2_side))
            q->n = CLOSED;
    }
    if (r->budget == 0)
        return;
    r->budget--;
    if (is_last_list(r))
        s->step = STEP_WRITE;
    else
        leave_tile(r);
}

/* Places the band's arrays one after another (see the top of this file). The
 * keys kept for a row have the same place in all bands of the row. */
static void lay_out_band(raster *r)
{
    const raster_state *const s = r->s;
    const uint32_t capacity = r->job->list_capacity;
    const size_t n = (size_t)s->band_cols * s->band_rows;

    r->nx = s->band_cols < r->cols - s->col ? s->band_cols : r->cols - s->col;
    r->ny = s->band_rows < r->rows - s->row ? s->band_rows : r->rows - s->row;
    r->queues = (raster_queue *)(r->pixels +
                                 (n << 2 * r->log2_side) * N_PLANES);
    r->kept = (saga_key *)(r->queues + n);
    /* Keeping keys pays only if a row of tiles has several bands. */
    r->kept_capacity = s->band_cols < r->cols ? capacity / 2 : 0;
    r->list = (uint32_t *)(r->kept + r->kept_capacity);
    r->capacity = 2 * (capacity - r->kept_capacity);
}

/* Moves to the next band. Returns 1 after the last. */
static int next_band(raster *r)
{
    raster_state *const s = r->s;

    s->step = STEP_OPEN;
    s->col += s->band_cols;
    if (s->col >= r->cols) {
        s->col = 0;
        s->row += s->band_rows;
        /* The kept keys belong to the previous row of tiles. */
        s->n_kept = 0;
        s->n_passed = 0;
    }
    if (s->row >= r->rows)
        return 1;
    lay_out_band(r);
    return 0;
}

/* Writes finished lines, one line per unit. Returns 1 when the last band has
 * been written. */
static int step_write(raster *r)
{
    raster_state *const s = r->s;
    const int32_t x = tile_x(r, s->tx), y = tile_y(r, s->ty);
    const uint32_t n = spend(r, r->side - s->line);
    const uint32_t *t = tile_pixels(r, s->tx, s->ty);
    uint32_t k;

    for (k = 0; k < n; k++, s->line++)
        if (y + (int32_t)s->line < r->job->y1)
            saga_raster_write(r, t + (s->line << r->log2_side), x,
                              y + (int32_t)s->line);
    if (s->line < r->side)
        return 0;
    /* With a single list all tiles use the pixel memory of the first tile. */
    s->step = s->is_first ? STEP_CLEAR : STEP_BLEND;
    return !next_tile(r) && next_band(r);
}

/* --- The job ------------------------------------------------------------- */

/* Returns the number of tiles that fit in n_bytes, at most all. Counting pixels
 * alone gives an upper bound n; the queues take 8 bytes more for each tile. */
static uint32_t count_tiles(size_t n_bytes, uint32_t log2_side, uint32_t all)
{
    const uint32_t shift = 2 * log2_side + 4;
    const size_t each = ((size_t)1 << shift) + sizeof(raster_queue);
    size_t n = n_bytes >> shift;

    if (n > all)
        n = all;
    n -= n * sizeof(raster_queue) >> shift;
    while (n * each > n_bytes)
        n--;
    return (uint32_t)n;
}

/* Sets the largest band: a part of a row of tiles, or as many whole rows as
 * fit. */
static void choose_band(raster *r, uint32_t n_tiles)
{
    raster_state *const s = r->s;

    *s = (raster_state){ .step = STEP_OPEN, .band_rows = 1 };
    s->band_cols = n_tiles < r->cols ? n_tiles : r->cols;
    while (s->band_rows < r->rows && (s->band_rows + 1) * r->cols <= n_tiles)
        s->band_rows++;
}

static uint32_t log2_of_side(int32_t tile)
{
    return tile == 8 ? 3 : tile == 16 ? 4 : tile == 32 ? 5 : tile == 64 ? 6 : 0;
}

/* Returns the number of bytes of scratch for tiles, without state and list; 0
 * if the scratch is too small. */
static size_t tile_nbytes(const saga_job *job)
{
    const size_t capacity = job->list_capacity;

    if (job->scratch_nbytes < STATE_NBYTES ||
        capacity > (job->scratch_nbytes - STATE_NBYTES) / sizeof(saga_key))
        return 0;
    return job->scratch_nbytes - STATE_NBYTES - capacity * sizeof(saga_key);
}

static int is_inside(const saga_job *job, const saga_camera *cam)
{
    return job->x0 >= 0 && job->y0 >= 0 && job->x0 < job->x1 &&
           job->y0 < job->y1 && job->x1 <= cam->width && job->y1 <= cam->height;
}

static uint32_t pixel_nbytes(int bits)
{
    return bits == SAGA_DEPTH ? sizeof(saga_depth) : bits == 16 ? 6 : 3;
}

/* Returns the alignment of rows and samples, less 1. */
static uint32_t alignment(int bits)
{
    return bits == SAGA_DEPTH ? 7 : bits == 16 ? 1 : 0;
}

/* Checks the destination, including that rows do not overlap. The width is
 * below 2^14.1 and the height at most 2^14, so that a stride of 2^48 exceeds
 * any capacity. */
static saga_status check_picture(const saga_picture *pic, const saga_job *job)
{
    const uint32_t width = (uint32_t)(job->x1 - job->x0);
    const uint32_t height = (uint32_t)(job->y1 - job->y0);
    const uint64_t line = (uint64_t)width * pixel_nbytes(pic->bits);
    const uint64_t stride = pic->stride_nbytes;

    if (height > 1 && stride < line)
        return SAGA_ERR_ARG;
    if (stride >> 48 || line + stride * (height - 1u) > pic->nbytes)
        return SAGA_ERR_SPACE;
    if (((uintptr_t)pic->rgb | pic->stride_nbytes) & alignment(pic->bits))
        return SAGA_ERR_ALIGN;
    return SAGA_OK;
}

static saga_status check(const saga_job *job, const saga_picture *pic,
                         const saga_camera *cam)
{
    const uint32_t log2_side = log2_of_side(job->tile);

    if (log2_side == 0 || job->list_capacity == 0 || !is_inside(job, cam) ||
        (pic->bits != 8 && pic->bits != 16 && pic->bits != SAGA_DEPTH))
        return SAGA_ERR_ARG;
    if (tile_nbytes(job) < ((size_t)16 << 2 * log2_side) + sizeof(raster_queue))
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
    r->box_shift = saga_raster_box_shift(r->cam);
    r->tiles_are_units = r->box_shift <= r->log2_side &&
                         !((uint32_t)(job->x0 | job->y0) &
                           ((1u << r->box_shift) - 1));
    r->s = job->scratch;
    r->pixels = (uint32_t *)job->scratch + STATE_NBYTES / 4;
    /* The first call writes the whole state, since the scratch has arbitrary
     * bytes. */
    if (job->cursor[0] == CURSOR_NEW)
        choose_band(
            r, count_tiles(tile_nbytes(job), r->log2_side, r->cols * r->rows));
    job->cursor[0] = CURSOR_BEGUN;
    lay_out_band(r);
}

/* Works on the job. Returns 1 if it is finished, 0 if the budget is used up. */
static int draw_until_pause(raster *r)
{
    while (r->budget > 0) {
        if (r->s->step == STEP_OPEN)
            step_open(r);
        else if (r->s->step == STEP_KEEP)
            saga_raster_keep(r);
        else if (r->s->step <= STEP_LIST)
            saga_raster_list(r);
        else if (r->s->step == STEP_CLEAR)
            step_clear(r);
        else if (r->s->step == STEP_BLEND)
            step_blend(r);
        else if (step_write(r))
            return 1;
    }
    return 0;
}

saga_status saga_raster(saga_job *job, const saga_picture *pic,
                        const saga_drawing *drawing, uint32_t budget)
{
    const saga_status status = check(job, pic, drawing->cam);
    raster r;

    if (status != SAGA_OK || job->cursor[0] == CURSOR_FINISHED)
        return status;
    r.pic = pic;
    r.cam = drawing->cam;
    r.splats = drawing->splats;
    r.order = drawing->order;
    r.n = drawing->n;
    r.cpu = drawing->cpu;
    r.tools = drawing->tools;
    r.budget = budget;
    open_job(&r, job);
    if (!draw_until_pause(&r))
        return SAGA_AGAIN;
    job->cursor[0] = CURSOR_FINISHED;
    return SAGA_OK;
}
