/* SPDX-License-Identifier: MIT
 *
 * The pixels of a tile and the blending of a splat into them, which the
 * rasteriser does in the forward pass and again in the backward pass. The
 * functions are inline in both files, because a call for each splat in each
 * tile would cost as much as its work.
 *
 * Work is done tile by tile and splat by splat, in blocks of 8 x 2 pixels; the
 * state of a tile fits L1. Blocks whose pixels are all outside the cut are
 * skipped.
 */
#ifndef SAGA_RASTER_TILE_H
#define SAGA_RASTER_TILE_H

#include "splat_tiles.h"
#include "threads.h"
#include "wide.h"

#include <string.h>

enum {
    TILE = SAGA_SPLAT_TILE,
    AREA = TILE * TILE,
    ROWS = WIDE_LANES / 8, /* rows of a block */
    PAIRS = TILE / ROWS,   /* blocks in a column */
    BLOCKS = AREA / WIDE_LANES,
    CHECK_EVERY = 32 /* splats between two checks for unfinished pixels */
};

/* Nanoseconds to draw a splat in a tile, and for everything else in a tile. */
enum { PAIR_NS = 40, TILE_NS = 200 };

/* The state of a tile's pixels, in blocks: first those of the left half from
 * top to bottom, then those of the right half. */
typedef struct {
    _Alignas(64) real trans[AREA];
    real colour[3][AREA]; /* sum so far */
    real slope[3][AREA];  /* dL/dC, for the backward pass */
    real rest[AREA];      /* D (see splat_raster_backward), for the backward
                           * pass */
    int x0, y0;           /* position of the tile in the picture */
    int width, height;    /* size of its part inside the picture */
} tile;

/* The rows of blocks and halves of a tile that a splat may touch. */
typedef struct {
    int y0, y1, x0, x1;
} window;

typedef struct {
    wide floor, cut, cap, square;
} limits;

/* alpha and blending weight alpha T of a splat in the pixels of a block. */
typedef struct {
    real alpha[WIDE_LANES], weight[WIDE_LANES];
} kept;

/* Coordinates of the pixels of each block, relative to the middle of the
 * tile. */
typedef struct {
    _Alignas(64) real x[2][WIDE_LANES], y[PAIRS][WIDE_LANES];
} grid;

static inline void fill_grid(grid *g)
{
    int i, k;

    for (i = 0; i < WIDE_LANES; i++) {
        for (k = 0; k < 2; k++)
            g->x[k][i] = R(8 * k + i % 8) + R(0.5) - TILE / 2;
        for (k = 0; k < PAIRS; k++)
            g->y[k][i] = R(ROWS * k + i / 8) + R(0.5) - TILE / 2;
    }
}

/* Returns the index of the first of eight pixels in row y, in the left half (0)
 * or the right half (1). */
static inline int eight_at(int half, int y)
{
    return (half * PAIRS + y / ROWS) * WIDE_LANES + y % ROWS * 8;
}

/* Returns how many of the eight pixels at eight_at(half, y) are inside the
 * picture. */
static inline int n_inside(const tile *t, int half)
{
    const int n = t->width - 8 * half;

    return n < 0 ? 0 : n > 8 ? 8 : n;
}

static inline void place(tile *t, const saga_splat_work *work, size_t index,
                         const saga_splat_camera *cam)
{
    t->x0 = TILE * (int)(index % work->n_tiles_x);
    t->y0 = TILE * (int)(index / work->n_tiles_x);
    t->width = cam->width - t->x0 < TILE ? cam->width - t->x0 : TILE;
    t->height = cam->height - t->y0 < TILE ? cam->height - t->y0 : TILE;
}

/* Sets the transmittance to 1, but to 0 outside the picture, so that pixels
 * there count as finished. */
static inline void clear_trans(tile *t)
{
    int half, y, x;

    memset(t->trans, 0, sizeof t->trans);
    for (half = 0; half < 2; half++)
        for (y = 0; y < t->height; y++)
            for (x = 0; x < n_inside(t, half); x++)
                t->trans[eight_at(half, y) + x] = 1;
}

static inline int all_finished(const tile *t, wide floor)
{
    wide top = wide_load(t->trans);
    int i;

    for (i = WIDE_LANES; i < AREA; i += WIDE_LANES)
        top = wide_max(wide_load(t->trans + i), top);
    return !wide_any(wide_at_least(top, floor));
}

static inline window clip(const saga_splat_2d *o, const tile *t)
{
    const int x0 = o->x0 - t->x0, x1 = o->x1 - t->x0;
    const int y0 = o->y0 - t->y0, y1 = o->y1 - t->y0;

    /* Rounds outwards to whole blocks and halves of the tile. */
    return (window){ .y0 = y0 > 0 ? y0 / ROWS : 0,
                     .y1 = y1 < TILE ? (y1 + ROWS - 1) / ROWS : PAIRS,
                     .x0 = x0 >= 8,
                     .x1 = x1 > 8 ? 2 : 1 };
}

static inline limits limits_of(const saga_splat_rules *rules)
{
    /* A floor of 0 stands for none, but pixels outside the picture must stay
     * below it. */
    const real floor = rules->t_floor > 0 ? rules->t_floor : REAL_MIN;

    return (limits){ wide_set1(floor), wide_set1(rules->cut),
                     wide_set1(rules->alpha_cap), wide_set1(rules->square) };
}

/* Sets d to the vector from the splat's mean to the middle of the tile. */
static inline void to_middle(real d[2], const saga_splat_2d *o, const tile *t)
{
    d[0] = R(t->x0 + TILE / 2) - o->mean[0];
    d[1] = R(t->y0 + TILE / 2) - o->mean[1];
}

/* The inputs that all tiles share. */
typedef struct {
    saga_canvas *canvas;
    int learn; /* backward pass from the truth (1) or from d_image
                * (0) */
    limits limit;
    grid grid;
} pass;

static inline pass pass_of(saga_canvas *canvas)
{
    pass p = { .canvas = canvas, .limit = limits_of(&canvas->rules) };

    fill_grid(&p.grid);
    return p;
}

/* Sets q of all blocks in the splat's window. Returns a bit mask of the blocks
 * that the splat touches. */
static inline unsigned touch(real q[BLOCKS][WIDE_LANES], const tile *t,
                             const saga_splat_2d *o, const pass *p)
{
    const window win = clip(o, t);
    const wide n = wide_set1(o->n), h = wide_set1(o->h);
    const wide q0 = wide_set1(o->q0);
    unsigned touched = 0;
    real d[2];
    int j, k;

    to_middle(d, o, t);
    for (k = win.x0; k < win.x1; k++) {
        const wide dx = wide_add(wide_load(p->grid.x[k]), wide_set1(d[0]));
        const wide g_dx = wide_mul(wide_set1(o->g), dx);

        for (j = win.y0; j < win.y1; j++) {
            const int b = k * PAIRS + j;
            const wide dy = wide_add(wide_load(p->grid.y[j]), wide_set1(d[1]));
            /* s = (g dx - n dy)^2 + (h dy)^2, and q = q0 + s + square s^2. */
            const wide v = wide_fnma(n, dy, g_dx), w = wide_mul(h, dy);
            const wide s = wide_fma(v, v, wide_mul(w, w));
            const wide at = wide_add(
                q0, wide_fma(wide_mul(s, s), p->limit.square, s));

            wide_store(q[b], at);
            touched |= (unsigned)wide_any(wide_less(at, p->limit.cut)) << b;
        }
    }
    return touched;
}

/* Blends a splat into the blocks that it touches, and writes its alpha and
 * weight for each of them to `to`. Returns the bit mask of these blocks. */
static inline unsigned blend(kept *to, tile *t, const saga_splat_2d *o,
                             const pass *p)
{
    const wide red = wide_set1(o->colour[0]);
    const wide green = wide_set1(o->colour[1]);
    const wide blue = wide_set1(o->colour[2]);
    _Alignas(64) real q[BLOCKS][WIDE_LANES];
    const unsigned touched = touch(q, t, o, p);
    unsigned left;

    for (left = touched; left; left &= left - 1, to++) {
        const int b = __builtin_ctz(left), at = b * WIDE_LANES;
        const wide q_b = wide_load(q[b]), trans = wide_load(t->trans + at);
        /* A finished pixel (T below the floor) takes nothing more. */
        const wide_mask on = wide_both(wide_less(q_b, p->limit.cut),
                                       wide_at_least(trans, p->limit.floor));
        const wide alpha = wide_keep(
            on, wide_min(wide_exp2_neg(q_b), p->limit.cap));
        const wide weight = wide_mul(alpha, trans);

        wide_store(to->alpha, alpha);
        wide_store(to->weight, weight);
        /* T becomes T (1 - alpha), and the colour grows by alpha T c. */
        wide_store(t->trans + at, wide_sub(trans, weight));
        wide_store(t->colour[0] + at,
                   wide_fma(weight, red, wide_load(t->colour[0] + at)));
        wide_store(t->colour[1] + at,
                   wide_fma(weight, green, wide_load(t->colour[1] + at)));
        wide_store(t->colour[2] + at,
                   wide_fma(weight, blue, wide_load(t->colour[2] + at)));
    }
    return touched;
}

static inline void begin_tile(tile *t, const pass *p, size_t index)
{
    place(t, &p->canvas->splat, index, &p->canvas->camera);
    clear_trans(t);
    memset(t->colour, 0, sizeof t->colour);
}

/* Adds the background where transmittance is left. */
static inline void end_tile(tile *t, const real *background)
{
    int i, c;

    for (c = 0; c < 3; c++)
        for (i = 0; i < AREA; i++)
            t->colour[c][i] += t->trans[i] * background[c];
}

/* Returns the index of eight pixels of the tile in a plane of the picture. */
static inline size_t plane_at(const tile *t, int half, int y, int width)
{
    return (size_t)(t->y0 + y) * (size_t)width + (size_t)(t->x0 + 8 * half);
}

static inline size_t plane_size(const saga_splat_camera *cam)
{
    return (size_t)cam->width * (size_t)cam->height;
}

/* Returns the splat of list entry e, and prefetches that of a later entry. The
 * lists access splats in random order; without this, the forward pass waits for
 * memory half of the time. */
static inline const saga_splat_2d *splat_at(const saga_splat_work *work,
                                            size_t e)
{
    const uint32_t ahead = work->pair[e + SAGA_SPLAT_AHEAD].splat;
    const saga_splat_2d *const next = work->splat + ahead;

    __builtin_prefetch(next);
    __builtin_prefetch(&next->y1);
    return work->splat + work->pair[e].splat;
}

/* Tells whether all pixels are finished; checks only after every CHECK_EVERY
 * splats. */
static inline int is_done(const tile *t, const pass *p, size_t nth)
{
    return nth % CHECK_EVERY == CHECK_EVERY - 1 &&
           all_finished(t, p->limit.floor);
}

static inline size_t n_tiles(const saga_splat_work *work)
{
    return (size_t)work->n_tiles_x * work->n_tiles_y;
}

/* Runs a function on all tiles. `times` is its cost relative to drawing
 * them. */
static inline void do_tiles(void (*run)(void *, size_t), pass *p, int times)
{
    const saga_splat_work *const w = &p->canvas->splat;

    saga_parallel(
        &(saga_tasks){ .run = run,
                       .user = p,
                       .n = n_tiles(w),
                       .ns = times * ((double)PAIR_NS * (double)w->n_pairs +
                                      (double)TILE_NS * (double)n_tiles(w)) });
}

#endif
