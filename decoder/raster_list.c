/* SPDX-License-Identifier: MIT
 *
 * Finds which splats touch which tile: boxes in the keys of a view, the keys
 * kept for a row of tiles, and the lists of a band, which are counted first and
 * then filled.
 */
#include "fx.h"
#include "raster_state.h"

/* --- Keys ---------------------------------------------------------------- */

/* Packs a box into four bytes of seven bits: its first column and row in units
 * of 2^shift pixels, and 127 minus its last column and row. A box overlaps a
 * rectangle if no byte of its key exceeds that of the rectangle's limit. */
static uint32_t pack(uint32_t x0, uint32_t x1, uint32_t y0, uint32_t y1)
{
    return x0 | (127 - x1) << 8 | y0 << 16 | (127 - y1) << 24;
}

/* A coordinate of a box has seven bits in a key. Returns the number of bits by
 * which the camera's longer side exceeds that, but at least 3, for a tile of
 * eight pixels. */
uint32_t saga_raster_box_shift(const saga_camera *cam)
{
    const uint32_t side = cam->width > cam->height ? cam->width : cam->height;
    uint32_t shift = 3;

    while ((side - 1) >> shift > 127)
        shift++;
    return shift;
}

uint64_t saga_raster_boxes(saga_key *order, const saga_splat *splats,
                           uint32_t n, const saga_camera *cam)
{
    const uint32_t shift = saga_raster_box_shift(cam);
    uint64_t pixels = 0;
    uint32_t i;

    for (i = 0; i < n; i++) {
        const saga_splat *const s = splats + order[i].index;

        order[i].depth = pack(
            (uint32_t)s->x0 >> shift, (uint32_t)(s->x1 - 1) >> shift,
            (uint32_t)s->y0 >> shift, (uint32_t)(s->y1 - 1) >> shift);
        pixels += (uint32_t)((s->x1 - s->x0) * (s->y1 - s->y0));
    }
    return pixels;
}

#define GUARDS 0x80808080u /* no byte borrows from the next */

/* Returns the limit, byte by byte, of the keys of splats that may touch these
 * tiles of the band. */
static uint32_t limit_of(const raster *r, uint32_t nx, uint32_t ny)
{
    const uint32_t shift = r->box_shift;
    const uint32_t x = (uint32_t)tile_x(r, 0), y = (uint32_t)tile_y(r, 0);
    const uint32_t x1 = (uint32_t)fx_min(tile_x(r, nx), r->job->x1) - 1;
    const uint32_t y1 = (uint32_t)fx_min(tile_y(r, ny), r->job->y1) - 1;

    /* The ends of the rectangle are where a key has its beginnings: a box
     * overlaps if it begins before the ends and ends after the beginnings. */
    return GUARDS | pack(x1 >> shift, x >> shift, y1 >> shift, y >> shift);
}

static int touches(saga_key key, uint32_t limit)
{
    return ((limit - key.depth) & GUARDS) == GUARDS;
}

/* Collects the keys that touch the row of tiles, one key tested per unit. */
void saga_raster_keep(raster *r)
{
    raster_state *const s = r->s;
    const uint32_t limit = limit_of(r, r->cols - s->col, r->ny);
    const uint32_t left = r->n - s->n_passed;
    const uint32_t end = s->n_passed + (left < r->budget ? left : r->budget);
    uint32_t i = s->n_passed, n = s->n_kept;

    while (i < end && n < r->kept_capacity) {
        const saga_key key = r->order[i++];

        /* The key is always stored, and kept by incrementing the count, which
         * avoids a branch that would be mispredicted. */
        r->kept[n] = key;
        n += (uint32_t)touches(key, limit);
    }
    r->budget -= i - s->n_passed;
    s->n_passed = i;
    s->n_kept = n;
    if (r->budget > 0)
        s->step = STEP_COUNT;
}

/* --- Listing ------------------------------------------------------------- */

/* A rectangle in pixels. */
typedef struct {
    int32_t x0, y0, x1, y1;
} box;

/* The tiles of the band that a splat may touch, both ends included. */
typedef struct {
    uint32_t x0, y0, x1, y1;
} tile_range;

static int box_tiles(tile_range *t, const raster *r, const box *b)
{
    const int32_t x = tile_x(r, 0), y = tile_y(r, 0);
    const int32_t x1 = fx_min(b->x1, fx_min(tile_x(r, r->nx), r->job->x1));
    const int32_t y1 = fx_min(b->y1, fx_min(tile_y(r, r->ny), r->job->y1));
    const int32_t x0 = fx_max(b->x0, x);
    const int32_t y0 = fx_max(b->y0, y);

    if (x0 >= x1 || y0 >= y1)
        return 0;
    t->x0 = (uint32_t)(x0 - x) >> r->log2_side;
    t->y0 = (uint32_t)(y0 - y) >> r->log2_side;
    t->x1 = (uint32_t)(x1 - 1 - x) >> r->log2_side;
    t->y1 = (uint32_t)(y1 - 1 - y) >> r->log2_side;
    return 1;
}

/* Finds the tiles that a splat may touch. If tiles begin at whole units of the
 * keys, the key is enough, and the splat need not be read from memory. */
static int splat_tiles(tile_range *t, const raster *r, saga_key key)
{
    const uint32_t shift = r->box_shift;
    const uint32_t k = key.depth;
    const saga_splat *s;
    box b;

    if (r->tiles_are_units) {
        b.x0 = (int32_t)((k & 127) << shift);
        b.x1 = (int32_t)((128 - (k >> 8 & 127)) << shift);
        b.y0 = (int32_t)((k >> 16 & 127) << shift);
        b.y1 = (int32_t)((128 - (k >> 24)) << shift);
    } else {
        s = r->splats + key.index;
        b.x0 = s->x0;
        b.x1 = s->x1;
        b.y0 = s->y0;
        b.y1 = s->y1;
    }
    return box_tiles(t, r, &b);
}

/* Counts a splat's tiles, or enters the splat in their lists, one tile per
 * unit. Returns 0 if the budget is used up or the list is full. */
static int visit_tiles(raster *r, raster_progress *at, const tile_range *t,
                       uint32_t splat)
{
    raster_state *const s = r->s;
    const int is_listing = at == &s->listed;
    uint32_t *const n = is_listing ? &s->n_listed : &s->n_counted;
    const uint32_t end = is_listing ? s->n_counted : r->capacity;

    while (at->y <= t->y1) {
        raster_queue *const q = tile_queue(r, at->x, at->y);

        /* A finished tile needs no entry, even if the list is full. */
        if (r->budget == 0 || (q->n != CLOSED && *n == end))
            return 0;
        r->budget--;
        if (q->n != CLOSED) {
            /* If these are not the splats that were counted (draw.c), some
             * may have no place in the list. */
            if (!is_listing)
                q->n++;
            else if (q->first + q->n < end)
                r->list[q->first + q->n++] = splat;
            ++*n;
        }
        if (at->x++ == t->x1) {
            at->x = t->x0;
            at->y++;
        }
    }
    return *n < end;
}

/* Tests a splat for the band, one unit, and visits its tiles. Returns 0 if
 * interrupted. */
static int visit_splat(raster *r, raster_progress *at, saga_key key)
{
    tile_range t;

    if (!splat_tiles(&t, r, key)) {
        r->budget--;
        return 1;
    }
    if (!at->is_begun) {
        at->is_begun = 1;
        at->x = t.x0;
        at->y = t.y0;
        r->budget--;
    }
    if (!visit_tiles(r, at, &t, key.index))
        return 0;
    at->is_begun = 0;
    return 1;
}

/* Visits keys[from..n), one key per unit. Returns the index at which it was
 * interrupted, or n. */
static uint32_t visit_keys(raster *r, raster_progress *at, const saga_key *keys,
                           uint32_t from, uint32_t n)
{
    const uint32_t limit = limit_of(r, r->nx, r->ny);

    for (; r->budget > 0 && from < n; from++)
        if (!touches(keys[from], limit))
            r->budget--;
        else if (!visit_splat(r, at, keys[from]))
            break;
    return from;
}

static void visit_all(raster *r, raster_progress *at)
{
    const raster_state *const s = r->s;

    /* First the keys kept for this row, then those not yet tested. */
    if (at->key < s->n_kept)
        at->key = visit_keys(r, at, r->kept, at->key, s->n_kept);
    if (at->key >= s->n_kept)
        at->key = s->n_kept + visit_keys(r, at, r->order + s->n_passed,
                                         at->key - s->n_kept,
                                         r->n - s->n_passed);
}

static void step_count(raster *r)
{
    visit_all(r, &r->s->counted);
    if (r->budget > 0)
        r->s->step = STEP_SUM;
}

/* Converts counts to places in the list, one tile per unit. n_listed holds the
 * sum meanwhile. */
static void step_sum(raster *r)
{
    raster_state *const s = r->s;
    const uint32_t n = r->nx * r->ny;

    for (; r->budget > 0 && s->tx < n; r->budget--) {
        raster_queue *const q = r->queues + s->tx++;

        if (q->n == CLOSED)
            continue;
        q->first = s->n_listed;
        s->n_listed += q->n;
        q->n = 0;
    }
    if (s->tx < n)
        return;
    s->tx = 0;
    s->n_listed = 0;
    s->step = STEP_LIST;
}

static void step_list(raster *r)
{
    raster_state *const s = r->s;

    /* This repeats the visit that counted, so that each entry has a place. It
     * ends with the keys at the latest. */
    if (s->n_listed < s->n_counted)
        visit_all(r, &s->listed);
    if (s->n_listed == s->n_counted ||
        s->listed.key == s->n_kept + (r->n - s->n_passed))
        s->step = s->is_first ? STEP_CLEAR : STEP_BLEND;
}

void saga_raster_list(raster *r)
{
    if (r->s->step == STEP_COUNT)
        step_count(r);
    else if (r->s->step == STEP_SUM)
        step_sum(r);
    else
        step_list(r);
}
