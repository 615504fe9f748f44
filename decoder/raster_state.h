/* SPDX-License-Identifier: MIT
 *
 * A job at work: raster.c walks through its bands and tiles, raster_list.c
 * finds the splats of each tile, raster_write.c writes finished lines.
 */
#ifndef SAGA_RASTER_STATE_H
#define SAGA_RASTER_STATE_H

#include "raster.h"

#define CLOSED 0xffffffffu           /* n of a finished tile's queue */
enum { STATE_NBYTES = 256, N_PLANES = 4 };
enum { CURSOR_NEW, CURSOR_BEGUN, CURSOR_FINISHED };
enum {
    STEP_OPEN, STEP_KEEP, STEP_COUNT, STEP_SUM, STEP_LIST, STEP_CLEAR,
    STEP_BLEND, STEP_WRITE
};

/* How far the band's keys are counted, or listed. */
typedef struct {
    uint32_t key;                   /* next one: a kept one, or n_kept + i for
                                     * the i-th behind those passed */
    uint32_t is_begun;              /* it is done with its tiles before */
    uint32_t x, y;                  /* this one */
} raster_progress;

/* Where the job stands. Tiles are counted from the job's corner in col and
 * row, from the band's in tx and ty. */
typedef struct {
    uint32_t step;
    uint32_t band_cols, band_rows;  /* largest band, in tiles */
    uint32_t col, row;              /* first tile of this band */
    uint32_t tx, ty;                /* tile at work */
    uint32_t line;                  /* next line of the tile (STEP_BLEND: of
                                     * the splat in it) */
    uint32_t n_passed;              /* number of keys, from the front of the
                                     * order, that were looked at for this row
                                     * of tiles */
    uint32_t n_kept;                /* number of those that are kept for it */
    raster_progress counted, listed;
    uint32_t is_first;              /* no list before this one in the band */
    uint32_t n_counted, n_listed;   /* entries of this list */
    uint32_t count;                 /* splats blended in this tile */
} raster_state;

_Static_assert(sizeof(raster_state) <= STATE_NBYTES, "SAGA_JOB_NBYTES");

/* The splats of one tile: list[first..first + n). */
typedef struct {
    uint32_t first, n;
} raster_queue;

_Static_assert(sizeof(raster_queue) == 8 && sizeof(saga_key) == 8,
               "SAGA_JOB_NBYTES");
_Static_assert(sizeof(saga_depth) == 16, "depths have no padding");

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
    uint32_t box_shift;             /* of the keys' boxes */
    int tiles_are_units;            /* ... whose units make whole tiles */
    uint32_t cols, rows;            /* of the job, tiles */
    uint32_t nx, ny;                /* of this band, tiles */
    raster_state *s;
    uint32_t *pixels;               /* planes of the band's first tile */
    raster_queue *queues;
    uint32_t *list;
    uint32_t capacity;              /* of the list */
    saga_key *kept;
    uint32_t kept_capacity;
    saga_cpu cpu;
    uint32_t tools;                 /* the drawing's */
} raster;

static inline raster_queue *tile_queue(const raster *r, uint32_t tx,
                                       uint32_t ty)
{
    return r->queues + (ty * r->nx + tx);
}

/* The picture's coordinates of a tile of the band. */
static inline int32_t tile_x(const raster *r, uint32_t tx)
{
    return r->job->x0 + (int32_t)((r->s->col + tx) << r->log2_side);
}

static inline int32_t tile_y(const raster *r, uint32_t ty)
{
    return r->job->y0 + (int32_t)((r->s->row + ty) << r->log2_side);
}

/* The shift from pixels to the units of the keys' boxes. */
uint32_t saga_raster_box_shift(const saga_camera *cam);

/* STEP_KEEP; STEP_COUNT, STEP_SUM or STEP_LIST. Both stop when the budget is
 * spent, or go on to the step behind them. */
void saga_raster_keep(raster *r);
void saga_raster_list(raster *r);

/* Writes line y of the picture from x on, as far as the tile and the job have
 * it; t is the first pixel of the line in the tile's planes. */
void saga_raster_write(const raster *r, const uint32_t *t, int32_t x,
                       int32_t y);

#endif
