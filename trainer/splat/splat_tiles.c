/* SPDX-License-Identifier: MIT
 *
 * Visible splats are sorted by the bits of their depth (by a stable radix sort,
 * so that equal depths stay in index order), and then counted and scattered
 * into the lists in that order. The scatter is stable, so the lists do not
 * depend on how the splats are divided among threads.
 */
#include "splat_tiles.h"

#include "alloc.h"

#include <string.h>
#include <tgmath.h>

enum { TILE = SAGA_SPLAT_TILE, RADIX_BITS = 11, RADIX = 1 << RADIX_BITS };

/* Nanoseconds to put a splat into the lists. */
enum { LIST_NS = 60 };

/* --- Order --------------------------------------------------------------- */

typedef struct {
    uint32_t key, index;
} depth_key;

/* For positive floats, the order of bits is the order of values. */
static uint32_t depth_bits(real depth)
{
    const float d = (float)depth;
    uint32_t bits;

    memcpy(&bits, &d, sizeof bits);
    return bits;
}

static void sort_pass(depth_key *to, const depth_key *from, uint32_t n,
                      int shift)
{
    uint32_t begin[RADIX] = { 0 };
    uint32_t i, sum = 0;

    for (i = 0; i < n; i++)
        begin[(from[i].key >> shift) % RADIX]++;
    /* Counts become the index at which the keys of each digit begin. */
    for (i = 0; i < RADIX; i++) {
        const uint32_t count = begin[i];

        begin[i] = sum;
        sum += count;
    }
    for (i = 0; i < n; i++)
        to[begin[(from[i].key >> shift) % RADIX]++] = from[i];
}

static bool sort_by_depth(saga_splat_work *work, saga_error *error)
{
    const size_t nbytes = work->n * sizeof(depth_key);
    depth_key *a, *b;
    uint32_t i, n = 0;

    if (!saga_canvas_grow(&work->scratch[0], &work->cap[10], nbytes, error) ||
        !saga_canvas_grow(&work->scratch[1], &work->cap[11], nbytes, error) ||
        !saga_canvas_grow((void **)&work->order, &work->cap[5],
                          work->n * sizeof *work->order, error))
        return false;
    a = work->scratch[0];
    b = work->scratch[1];
    for (i = 0; i < work->n; i++)
        if (work->extent[i] > 0)
            a[n++] = (depth_key){ depth_bits(work->splat[i].depth), i };
    /* The least significant digit comes first; three of 11 bits cover 32. The
     * third pass ends in b. */
    sort_pass(b, a, n, 0);
    sort_pass(a, b, n, RADIX_BITS);
    sort_pass(b, a, n, 2 * RADIX_BITS);
    for (i = 0; i < n; i++)
        work->order[i] = b[i].index;
    work->n_visible = n;
    return true;
}

/* --- Tiles of a splat ---------------------------------------------------- */

static int floor_tile(int x)
{
    return x / TILE;
}

static int ceil_tile(int x)
{
    return (x + TILE - 1) / TILE;
}

static int clamp_int(real x, int lo, int hi)
{
    return x < R(lo) ? lo : x > R(hi) ? hi : (int)x;
}

/* Sets [*c0, *c1) to the columns of tiles that the ellipse q < cut touches in
 * pixel rows ya..yb-1: its extremes in x over these rows, widened by more than
 * the rounding error. At dy the ellipse covers (n dy +- sqrt(rest - h^2 dy^2))
 * / g, which is extreme at dy = +-n sqrt(rest / (n^2 + h^2)) / h, or at the
 * first or last row. */
static void columns(int *c0, int *c1, const saga_splat_2d *o, int ya, int yb,
                    real cut)
{
    const real rest = (cut - o->q0) * R(1.001) + R(0.001);
    const real tall = sqrt(rest) / o->h;
    const real peak = o->n * sqrt(rest / (o->n * o->n + o->h * o->h)) / o->h;
    real lo = R(ya) + R(0.5) - o->mean[1];
    real hi = R(yb) - R(0.5) - o->mean[1];
    real a, b, right, left, slack;

    /* The rows are limited to the height of the ellipse. */
    lo = saga_clamp(lo, -tall, tall);
    hi = saga_clamp(hi, -tall, tall);
    a = saga_clamp(peak, lo, hi);
    b = saga_clamp(-peak, lo, hi);
    right = rest - o->h * o->h * a * a;
    left = rest - o->h * o->h * b * b;
    right = (o->n * a + (right > 0 ? sqrt(right) : 0)) / o->g;
    left = (o->n * b - (left > 0 ? sqrt(left) : 0)) / o->g;
    slack = R(0.05) + R(1e-4) * (fabs(right) + fabs(left) + tall);
    *c0 = floor_tile(
        clamp_int(floor(o->mean[0] + left - slack), o->x0, o->x1 - 1));
    *c1 = 1 + floor_tile(clamp_int(ceil(o->mean[0] + right + slack), o->x0,
                                   o->x1 - 1));
}

/* Sets the columns for one row of tiles. For a small splat they are those of
 * its bounding box. */
static void tile_columns(int *c0, int *c1, const saga_splat_2d *o, int row,
                         real cut)
{
    const int ya = row * TILE > o->y0 ? row * TILE : o->y0;
    const int yb = row * TILE + TILE < o->y1 ? row * TILE + TILE : o->y1;

    *c0 = floor_tile(o->x0);
    *c1 = ceil_tile(o->x1);
    if (*c1 - *c0 > 1 && (o->x1 - o->x0 > TILE || *c1 - *c0 > 2))
        columns(c0, c1, o, ya, yb, cut);
    if (*c1 < *c0)
        *c1 = *c0;
}

/* --- Lists --------------------------------------------------------------- */

/* Returns the begin of a part of [0, n), equal in both passes. */
static uint32_t part_begin(uint32_t n, size_t part, size_t n_parts)
{
    return (uint32_t)((uint64_t)n * part / n_parts);
}

/* The inputs that all parts share. */
typedef struct {
    saga_splat_work *work;
    size_t *count; /* (parts, tiles) */
    size_t n_parts, n_tiles;
    real cut;
} listing;

/* Counts the entries of one part for each tile, and the slots of each splat. */
static void count_part(void *user, size_t part)
{
    const listing *const l = user;
    saga_splat_work *const work = l->work;
    const uint32_t end = part_begin(work->n_visible, part + 1, l->n_parts);
    size_t *const count = l->count + part * l->n_tiles;
    const real cut = l->cut;
    uint32_t r;

    for (r = part_begin(work->n_visible, part, l->n_parts); r < end; r++) {
        const saga_splat_2d *const o = work->splat + work->order[r];
        uint32_t slots = 0;
        int row, c0, c1, c;

        for (row = floor_tile(o->y0); row < ceil_tile(o->y1); row++) {
            tile_columns(&c0, &c1, o, row, cut);
            for (c = c0; c < c1; c++)
                count[(size_t)row * work->n_tiles_x + (size_t)c]++;
            slots += (uint32_t)(c1 - c0);
        }
        /* The count is written one index higher, so that the sums in
         * begin_lists become the begin of each splat's slots. */
        work->slot_begin[work->order[r] + 1u] = slots;
    }
}

static void scatter_part(void *user, size_t part)
{
    const listing *const l = user;
    saga_splat_work *const work = l->work;
    const uint32_t end = part_begin(work->n_visible, part + 1, l->n_parts);
    size_t *const next = l->count + part * l->n_tiles;
    const real cut = l->cut;
    uint32_t r;

    for (r = part_begin(work->n_visible, part, l->n_parts); r < end; r++) {
        const saga_splat_2d *const o = work->splat + work->order[r];
        uint32_t slot = work->slot_begin[work->order[r]];
        int row, c0, c1, c;

        for (row = floor_tile(o->y0); row < ceil_tile(o->y1); row++) {
            tile_columns(&c0, &c1, o, row, cut);
            for (c = c0; c < c1; c++) {
                const size_t t = (size_t)row * work->n_tiles_x + (size_t)c;

                /* Slots are numbered by splat, so that all records of a splat
                 * are adjacent; lists are by tile. */
                work->pair[next[t]++] = (saga_splat_pair){ work->order[r],
                                                           slot++ };
            }
        }
    }
}

/* Replaces count[part][tile] by the index at which this part's entries of the
 * tile begin. Returns the number of pairs. */
static size_t prefix_tiles(size_t *count, saga_splat_work *work, size_t n_tiles,
                           size_t n_parts)
{
    size_t sum = 0, t, part;

    for (t = 0; t < n_tiles; t++) {
        work->tile_begin[t] = sum;
        /* Within a tile the parts follow each other, and each part is a range
         * of depths, so every list is sorted by depth. */
        for (part = 0; part < n_parts; part++) {
            size_t *const c = count + part * n_tiles + t;
            const size_t n = *c;

            *c = sum;
            sum += n;
        }
    }
    work->tile_begin[n_tiles] = sum;
    return sum;
}

/* Allocates the lists when their lengths are known. */
static bool begin_lists(const listing *l, saga_error *error)
{
    saga_splat_work *const work = l->work;
    uint32_t i;

    for (i = 0; i < work->n; i++)
        work->slot_begin[i + 1] += work->slot_begin[i];
    work->n_pairs = prefix_tiles(l->count, work, l->n_tiles, l->n_parts);
    if (work->n_pairs > UINT32_MAX)
        return saga_no_memory(0, "drawing a picture", error);
    if (!saga_canvas_grow(
            (void **)&work->pair, &work->cap[7],
            (work->n_pairs + SAGA_SPLAT_AHEAD) * sizeof *work->pair, error))
        return false;
    /* Reads past the end of the lists, for prefetching, find splat 0, which
     * exists. */
    memset(work->pair + work->n_pairs, 0,
           SAGA_SPLAT_AHEAD * sizeof *work->pair);
    return true;
}

static bool fill_lists(saga_splat_work *work, size_t n_tiles, real cut,
                       saga_error *error)
{
    const double ns = (double)LIST_NS * work->n_visible;
    const size_t n_parts = saga_team(ns);
    const size_t count_nbytes = n_parts * n_tiles * sizeof(size_t);
    listing l = { work, NULL, n_parts, n_tiles, cut };

    if (!saga_canvas_grow(&work->scratch[2], &work->cap[12], count_nbytes,
                          error))
        return false;
    l.count = work->scratch[2];
    memset(l.count, 0, count_nbytes);
    memset(work->slot_begin, 0, (work->n + 1u) * sizeof *work->slot_begin);
    /* Both passes find the same tiles for a splat, so counts and entries
     * agree. */
    saga_parallel(
        &(saga_tasks){ .run = count_part, .user = &l, .n = n_parts, .ns = ns });
    if (!begin_lists(&l, error))
        return false;
    saga_parallel(&(saga_tasks){
        .run = scatter_part, .user = &l, .n = n_parts, .ns = ns });
    return true;
}

bool saga_splat_tiles(saga_canvas *canvas, saga_error *error)
{
    saga_splat_work *const work = &canvas->splat;
    size_t n_tiles;

    work->n_tiles_x = (uint32_t)ceil_tile(canvas->camera.width);
    work->n_tiles_y = (uint32_t)ceil_tile(canvas->camera.height);
    n_tiles = (size_t)work->n_tiles_x * work->n_tiles_y;
    return sort_by_depth(work, error) &&
           saga_canvas_grow((void **)&work->slot_begin, &work->cap[6],
                            (work->n + 1u) * sizeof *work->slot_begin, error) &&
           saga_canvas_grow((void **)&work->tile_begin, &work->cap[8],
                            (n_tiles + 1) * sizeof *work->tile_begin, error) &&
           fill_lists(work, n_tiles, canvas->rules.cut, error);
}
