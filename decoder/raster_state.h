/* SPDX-License-Identifier: MIT
 *
 * The state of a job: raster.c visits its bands and tiles, raster_list.c finds
 * the splats of each tile, raster_write.c writes finished lines.
 */
#ifndef SAGA_RASTER_STATE_H
#define SAGA_RASTER_STATE_H

#include "raster.h"

#define CLOSED 0xffffffffu /* n of a finished tile's queue */
enum { STATE_NBYTES = 256, N_PLANES = 4 };
enum { CURSOR_NEW, CURSOR_BEGUN, CURSOR_FINISHED };
enum {
    STEP_OPEN,
    STEP_KEEP,
    STEP_COUNT,
    STEP_SUM,
    STEP_LIST,
    STEP_CLEAR,
    STEP_BLEND,
    STEP_WRITE
};

/* The progress of a pass that counts or lists the band's keys. */
typedef struct {
    uint32_t key;      /* next key: a kept key, or n_kept + i for
                        * the i-th key after n_passed */
    uint32_t is_begun; /* 1: tiles before (x, y) are done for it */
    uint32_t x, y;     /* its next tile */
} raster_progress;

/* The progress of a job. col and row count tiles from the corner of the job, tx
 * and ty from the corner of the band. */
typedef struct {
    uint32_t step;
    uint32_t band_cols, band_rows; /* largest band, in tiles */
    uint32_t col, row;             /* first tile of this band */
    uint32_t tx, ty;               /* current tile */
    uint32_t line;                 /* next line of the tile, or in STEP_BLEND
                                    * of the splat in the tile */
    uint32_t n_passed;             /* number of keys, from the front of the
                                    * order, that were tested for this row of
                                    * tiles */
    uint32_t n_kept;               /* number of these that touch the row */
    raster_progress counted, listed;
    uint32_t is_first;            /* 1: this is the first list of the band */
    uint32_t n_counted, n_listed; /* entries of this list */
    uint32_t count;               /* splats blended in this tile */
} raster_state;

_Static_assert(sizeof(raster_state) <= STATE_NBYTES, "SAGA_JOB_NBYTES");

/* The splats of one tile: list[first..first + n). */
typedef struct {
    uint32_t first, n;
} raster_queue;

_Static_assert(sizeof(raster_queue) == 8 && sizeof(saga_key) == 8,
               "SAGA_JOB_NBYTES");
_Static_assert(sizeof(saga_depth) == 16, "depths have no padding");

/* The values of one call of saga_raster. */
typedef struct {
    const saga_job *job;
    const saga_picture *pic;
    const saga_camera *cam;
    const saga_splat *splats;
    const saga_key *order;
    uint32_t n;
    uint32_t budget;
    uint32_t side, log2_side; /* size of a tile, pixels */
    uint32_t box_shift;       /* shift of the keys' boxes */
    int tiles_are_units;      /* 1: a tile is a whole number of units */
    uint32_t cols, rows;      /* size of the job, tiles */
    uint32_t nx, ny;          /* size of this band, tiles */
    raster_state *s;
    uint32_t *pixels; /* planes of the band's first tile */
    raster_queue *queues;
    uint32_t *list;
    uint32_t capacity; /* entries of the list */
    saga_key *kept;
    uint32_t kept_capacity;
    saga_cpu cpu;
    uint32_t tools; /* the drawing's */
} raster;

static inline raster_queue *tile_queue(const raster *r, uint32_t tx,
                                       uint32_t ty)
{
    return r->queues + (ty * r->nx + tx);
}

/* Return the picture's coordinates of a tile of the band. */
static inline int32_t tile_x(const raster *r, uint32_t tx)
{
    return r->job->x0 + (int32_t)((r->s->col + tx) << r->log2_side);
}

static inline int32_t tile_y(const raster *r, uint32_t ty)
{
    return r->job->y0 + (int32_t)((r->s->row + ty) << r->log2_side);
}

/* Returns the shift from pixels to the units of the keys' boxes. */
uint32_t saga_raster_box_shift(const saga_camera *cam);

/* saga_raster_keep carries out STEP_KEEP, saga_raster_list STEP_COUNT, STEP_SUM
 * or STEP_LIST. Both stop when the budget is used up, or set the next step. */
void saga_raster_keep(raster *r);
void saga_raster_list(raster *r);

/* Writes the pixels of line y from x on that lie in both the tile and the job;
 * t is the first pixel of the line in the tile's planes. */
void saga_raster_write(const raster *r, const uint32_t *t, int32_t x,
                       int32_t y);

#endif
