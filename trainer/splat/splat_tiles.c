/* SPDX-License-Identifier: MIT
 *
 * Visible splats are sorted by the bits of their depth (by a stable radix sort,
 * so that equal depths stay in index order), and then counted and scattered
 * into the lists in that order. Both work on parts of the splats: counts of
 * each part come first, then the place where each part puts its entries. Since
 * parts follow each other in every bin, the result does not depend on how the
 * splats are divided among threads.
 *
 * Splats are read in random order by the lists, so a box of eight bytes for
 * each of them is made first; all boxes fit the second cache.
 */
#include "splat_tiles.h"

#include "alloc.h"
#include "vec.h"

#include <string.h>
#include <tgmath.h>

enum { TILE = SAGA_SPLAT_TILE, RADIX_BITS = 11, RADIX = 1 << RADIX_BITS };

/* Nanoseconds for a splat in each stage of the sort, and in one of the two that
 * make the lists. */
enum { SORT_NS = 3, LIST_NS = 30 };

/* --- Parts --------------------------------------------------------------- */

/* Returns the begin of a part of [0, n). */
static uint32_t part_begin(uint32_t n, size_t part, size_t n_parts)
{
    return (uint32_t)((uint64_t)n * part / n_parts);
}

/* Replaces count[part][bin] by the number of entries that earlier parts have in
 * the bin, and sets begin (n_bins + 1) to the index at which each bin begins.
 * Returns the number of all entries. */
static size_t place_bins(uint32_t *count, size_t *begin, size_t n_bins,
                         size_t n_parts)
{
    size_t sum = 0;

    memset(begin, 0, (n_bins + 1) * sizeof *begin);
    for (size_t part = 0; part < n_parts; part++)
        for (size_t bin = 0; bin < n_bins; bin++) {
            uint32_t *const c = count + part * n_bins + bin;
            const uint32_t n = *c;

            *c = (uint32_t)begin[bin];
            begin[bin] += n;
        }
    for (size_t bin = 0; bin <= n_bins; bin++) {
        const size_t n = begin[bin];

        begin[bin] = sum;
        sum += n;
    }
    return sum;
}

/* --- Order --------------------------------------------------------------- */

typedef struct {
    uint32_t key, index;
} depth_key;

/* The tiles that a splat may touch: columns x0 to x1 - 1, rows y0 to y1 - 1. A
 * splat with x1 = 0 has different columns in each row (columns). */
typedef struct {
    uint16_t x0, y0, x1, y1;
} tile_box;

/* The sort of the visible splats, and the lists that are made of them. */
typedef struct {
    saga_splat_work *work;
    size_t n_parts, n_tiles;
    tile_box *box;        /* (n) */
    depth_key *from, *to; /* (n) */
    uint32_t *n_of;       /* (parts) number of visible splats of each */
    uint32_t *count;      /* (parts, bins) */
    size_t begin[RADIX + 1];
    int shift; /* of the present digit; 2 RADIX_BITS for the last one */
    real cut;
} listing;

/* For positive floats, the order of bits is the order of values. */
static uint32_t depth_bits(real depth)
{
    const float d = (float)depth;
    uint32_t bits;

    memcpy(&bits, &d, sizeof bits);
    return bits;
}

static uint32_t digit(const listing *l, const depth_key *k)
{
    return (k->key >> l->shift) % RADIX;
}

static tile_box box_of(const saga_splat_2d *o)
{
    const int x0 = o->x0 / TILE, x1 = (o->x1 + TILE - 1) / TILE;
    /* The bounding box of a small splat has hardly more tiles than the splat
     * itself. */
    const bool is_small = x1 - x0 <= 1 ||
                          (x1 - x0 == 2 && o->x1 - o->x0 <= TILE);

    return (tile_box){ .x0 = (uint16_t)x0,
                       .y0 = (uint16_t)(o->y0 / TILE),
                       .x1 = is_small ? (uint16_t)x1 : 0,
                       .y1 = (uint16_t)((o->y1 + TILE - 1) / TILE) };
}

/* Makes the boxes of a part, and the keys of its visible splats, at the place
 * in `from` where the part begins; counts the keys' first digit. */
static void key_part(void *user, size_t part)
{
    const listing *const l = user;
    const saga_splat_work *const work = l->work;
    const uint32_t begin = part_begin(work->n, part, l->n_parts);
    const uint32_t end = part_begin(work->n, part + 1, l->n_parts);
    uint32_t *const count = l->count + part * RADIX;
    uint32_t n = begin;

    memset(count, 0, RADIX * sizeof *count);
    for (uint32_t i = begin; i < end; i++) {
        const saga_splat_2d *const o = work->splat + i;

        if (!(work->extent[i] > 0))
            continue;
        l->box[i] = box_of(o);
        l->from[n] = (depth_key){ depth_bits(o->depth), i };
        count[digit(l, l->from + n)]++;
        n++;
    }
    l->n_of[part] = n - begin;
}

/* Counts a digit of the keys in a part, which are without gaps by now. */
static void digit_part(void *user, size_t part)
{
    const listing *const l = user;
    const uint32_t n = l->work->n_visible;
    const uint32_t end = part_begin(n, part + 1, l->n_parts);
    uint32_t *const count = l->count + part * RADIX;
    uint32_t i = part_begin(n, part, l->n_parts);

    l->n_of[part] = end - i;
    memset(count, 0, RADIX * sizeof *count);
    for (; i < end; i++)
        count[digit(l, l->from + i)]++;
}

/* Moves the keys of a part to their places by a digit; the last digit leaves
 * only their indices. */
static void move_part(void *user, size_t part)
{
    const listing *const l = user;
    const saga_splat_work *const work = l->work;
    const uint32_t n = l->shift == 0 ? work->n : work->n_visible;
    const depth_key *from = l->from + part_begin(n, part, l->n_parts);
    const depth_key *const end = from + l->n_of[part];
    uint32_t *const next = l->count + part * RADIX;

    for (size_t i = 0; i < RADIX; i++)
        next[i] += (uint32_t)l->begin[i];
    if (l->shift == 2 * RADIX_BITS)
        for (; from < end; from++)
            work->order[next[digit(l, from)]++] = from->index;
    else
        for (; from < end; from++)
            l->to[next[digit(l, from)]++] = *from;
}

static void run_parts(listing *l, void (*run)(void *, size_t), double ns)
{
    saga_parallel(&(saga_tasks){
        .run = run, .user = l, .n = l->n_parts, .ns = ns * l->work->n });
}

/* Sorts by one digit after the other, the least significant first; three of 11
 * bits cover 32. */
static void sort_by_depth(listing *l)
{
    for (l->shift = 0; l->shift <= 2 * RADIX_BITS; l->shift += RADIX_BITS) {
        depth_key *const from = l->from;

        run_parts(l, l->shift == 0 ? key_part : digit_part, SORT_NS);
        l->work->n_visible = (uint32_t)place_bins(l->count, l->begin, RADIX,
                                                  l->n_parts);
        run_parts(l, move_part, SORT_NS);
        l->from = l->to;
        l->to = from;
    }
}

/* --- Tiles of a splat ---------------------------------------------------- */

/* The columns of tiles that a splat touches in as many rows of tiles as a
 * vector has lanes: begin to end - 1 in each. */
typedef struct {
    real_bits begin[VEC_LANES], end[VEC_LANES];
} columns;

/* Sets the columns that the ellipse q < cut touches from a row of tiles on: its
 * extremes in x over the pixel rows of each, widened by more than the rounding
 * error. At dy the ellipse covers (n dy +- sqrt(rest - h^2 dy^2)) / g, which is
 * extreme at dy = +-n sqrt(rest / (n^2 + h^2)) / h, or at the first or last
 * pixel row. */
static void find_columns(columns *c, const saga_splat_2d *o, int row, real cut)
{
    const real rest = (cut - o->q0) * R(1.001) + R(0.001);
    const real h2 = o->h * o->h, per_g = 1 / o->g;
    const real tall = sqrt(rest) / o->h;
    const real peak = o->n * sqrt(rest / (o->n * o->n + h2)) / o->h;
    const vec most = vec_set1(tall), least = vec_set1(-tall);
    const vec first = R(TILE) * (R(row) + vec_iota()) - o->mean[1];
    /* The middles of the first and last pixel row, limited to the height of the
     * ellipse. */
    const vec lo = vec_clamp(
        vec_max(first, vec_set1(R(o->y0) - o->mean[1])) + R(0.5), least, most);
    const vec hi = vec_clamp(
        vec_min(first + R(TILE), vec_set1(R(o->y1) - o->mean[1])) - R(0.5),
        least, most);
    const vec a = vec_clamp(vec_set1(peak), lo, hi);
    const vec b = vec_clamp(vec_set1(-peak), lo, hi);
    const vec wide_a = vec_sqrt(vec_max(vec_zero(), rest - h2 * a * a));
    const vec wide_b = vec_sqrt(vec_max(vec_zero(), rest - h2 * b * b));
    const vec right = (o->n * a + wide_a) * per_g;
    const vec left = (o->n * b - wide_b) * per_g;
    const vec slack = R(0.05) +
                      R(1e-4) * (vec_abs(right) + vec_abs(left) + tall);
    const vec x0 = vec_set1(R(o->x0)), x1 = vec_set1(R(o->x1 - 1));
    /* Pixels are at least 0, so that conversion is floor. */
    const vec from = vec_clamp(o->mean[0] + left - slack, x0, x1);
    const vec to = vec_clamp(o->mean[0] + right + slack, x0, x1);
    const veci begin = __builtin_convertvector(from, veci);
    const veci whole = __builtin_convertvector(to, veci);
    const veci end = whole - (veci)(__builtin_convertvector(whole, vec) < to);

    for (int l = 0; l < VEC_LANES; l++) {
        c->begin[l] = begin[l] / TILE;
        c->end[l] = end[l] / TILE + 1;
    }
}

typedef struct {
    int begin, end;
} tile_row;

/* Returns the columns in a row of tiles. Rows are asked for in order from the
 * box's first on; `found` has those of a vector between two calls. */
static tile_row row_of(columns *found, const saga_splat_2d *o, tile_box b,
                       int row, real cut)
{
    const int lane = (row - b.y0) % VEC_LANES;

    if (b.x1 != 0)
        return (tile_row){ b.x0, b.x1 };
    if (lane == 0)
        find_columns(found, o, row, cut);
    return (tile_row){ (int)found->begin[lane], (int)found->end[lane] };
}

/* --- Lists --------------------------------------------------------------- */

/* Counts the entries of one part for each tile, and the slots of each splat. */
static void count_part(void *user, size_t part)
{
    const listing *const l = user;
    saga_splat_work *const work = l->work;
    const uint32_t end = part_begin(work->n_visible, part + 1, l->n_parts);
    uint32_t *const count = l->count + part * l->n_tiles;
    uint32_t r;

    memset(count, 0, l->n_tiles * sizeof *count);
    for (r = part_begin(work->n_visible, part, l->n_parts); r < end; r++) {
        const uint32_t i = work->order[r];
        const tile_box b = l->box[i];
        columns found;
        uint32_t slots = 0;

        for (int row = b.y0; row < b.y1; row++) {
            const tile_row t = row_of(&found, work->splat + i, b, row, l->cut);

            for (int c = t.begin; c < t.end; c++)
                count[(size_t)row * work->n_tiles_x + (size_t)c]++;
            slots += t.begin < t.end ? (uint32_t)(t.end - t.begin) : 0;
        }
        /* The count is written one index higher, so that the sums in
         * begin_lists become the begin of each splat's slots. */
        work->slot_begin[i + 1u] = slots;
    }
}

static void scatter_part(void *user, size_t part)
{
    const listing *const l = user;
    saga_splat_work *const work = l->work;
    const uint32_t end = part_begin(work->n_visible, part + 1, l->n_parts);
    uint32_t *const next = l->count + part * l->n_tiles;
    uint32_t r;

    for (size_t t = 0; t < l->n_tiles; t++)
        next[t] += (uint32_t)work->tile_begin[t];
    for (r = part_begin(work->n_visible, part, l->n_parts); r < end; r++) {
        const uint32_t i = work->order[r];
        const tile_box b = l->box[i];
        columns found;
        uint32_t slot = work->slot_begin[i];

        for (int row = b.y0; row < b.y1; row++) {
            const tile_row t = row_of(&found, work->splat + i, b, row, l->cut);
            uint32_t *const at = next + (size_t)row * work->n_tiles_x;

            /* Slots are numbered by splat, so that all records of a splat are
             * adjacent; lists are by tile. */
            for (int c = t.begin; c < t.end; c++)
                work->pair[at[c]++] = (saga_splat_pair){ i, slot++ };
        }
    }
}

/* Allocates the lists when their lengths are known. */
static bool begin_lists(const listing *l, saga_error *error)
{
    saga_splat_work *const work = l->work;
    uint32_t i;

    for (i = 0; i < work->n; i++)
        work->slot_begin[i + 1] += work->slot_begin[i];
    work->n_pairs = place_bins(l->count, work->tile_begin, l->n_tiles,
                               l->n_parts);
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

/* Allocates everything but the lists themselves. */
static bool reserve(listing *l, saga_error *error)
{
    saga_splat_work *const work = l->work;
    const size_t n = work->n;
    /* Counts serve the sort first, then the lists. */
    const size_t n_bins = l->n_tiles > RADIX ? l->n_tiles : RADIX;

    if (!saga_canvas_grow(&work->scratch[0], &work->cap[10],
                          2 * n * sizeof *l->from, error) ||
        !saga_canvas_grow(&work->scratch[1], &work->cap[11], n * sizeof *l->box,
                          error) ||
        !saga_canvas_grow(&work->scratch[2], &work->cap[12],
                          l->n_parts * (n_bins + 1) * sizeof *l->count,
                          error) ||
        !saga_canvas_grow((void **)&work->order, &work->cap[5],
                          n * sizeof *work->order, error) ||
        !saga_canvas_grow((void **)&work->slot_begin, &work->cap[6],
                          (n + 1) * sizeof *work->slot_begin, error) ||
        !saga_canvas_grow((void **)&work->tile_begin, &work->cap[8],
                          (l->n_tiles + 1) * sizeof *work->tile_begin, error))
        return false;
    l->from = work->scratch[0];
    l->to = l->from + n;
    l->box = work->scratch[1];
    l->count = work->scratch[2];
    l->n_of = l->count + l->n_parts * n_bins;
    return true;
}

bool saga_splat_tiles(saga_canvas *canvas, saga_error *error)
{
    saga_splat_work *const work = &canvas->splat;
    listing l = { .work = work,
                  .n_parts = saga_team((double)LIST_NS * work->n),
                  .cut = canvas->rules.cut };

    work->n_tiles_x = (uint32_t)saga_n_parts((size_t)canvas->camera.width,
                                             TILE);
    work->n_tiles_y = (uint32_t)saga_n_parts((size_t)canvas->camera.height,
                                             TILE);
    l.n_tiles = (size_t)work->n_tiles_x * work->n_tiles_y;
    if (!reserve(&l, error))
        return false;
    sort_by_depth(&l);
    /* Both passes over the lists find the same tiles for a splat, so counts and
     * entries agree. Splats that are not visible have no slots. */
    memset(work->slot_begin, 0, (work->n + 1u) * sizeof *work->slot_begin);
    run_parts(&l, count_part, LIST_NS);
    if (!begin_lists(&l, error))
        return false;
    run_parts(&l, scatter_part, LIST_NS);
    return true;
}

SAGA_ISA_CHOOSE(saga_splat_tiles);
