/* SPDX-License-Identifier: MIT
 *
 * A canvas is one picture in the making: where it is seen from and when, what
 * was drawn, what should have been, the gradient between them, and the work
 * areas of the passes over it. Whoever draws has one, large enough for the
 * largest picture.
 *
 * Pictures are planar, (3, H, W) of canvas->camera, values 0..1. Pixels: (0, 0)
 * is the corner of the picture, centres lie at +1/2.
 */
#ifndef SAGA_CANVAS_H
#define SAGA_CANVAS_H

#include "error.h"
#include "real.h"

#include <stddef.h>
#include <stdint.h>

/* A pinhole camera; x right, y down, z forward. */
typedef struct saga_splat_camera {
    real rotation[9];     /* rows: camera axes in scene axes */
    real centre[3];       /* scene units */
    real focal[2];        /* pixels, > 0 */
    real principal[2];    /* pixels */
    real near_plane;      /* > 0 */
    int width, height;    /* 1..16384 */
    real background[3];
} saga_splat_camera;

/* saga_canvas_init sets the norm's constants, which only tests change: finite
 * differences are wrong wherever a pixel crosses the cut or the floor. */
typedef struct saga_splat_rules {
    real cut;             /* a splat touches pixels with q < cut */
    real alpha_cap;
    real t_floor;         /* a pixel is finished below it */
    real low_pass;        /* pixels^2, added to the 2-D covariance */
    real square;          /* what the square of s counts in q: 0 at first, 1/2
                           * where splats fall off steeply */
    int detach_time;      /* 1: no gradient to t_centre and log2_width through
                           * motion and slope; 0 at first */
} saga_splat_rules;

/* Primitives at one time. */
typedef struct saga_splat_posed {
    real *mean;           /* (N, 3) */
    real *quat;           /* (N, 4) not normalised */
    real *q0;             /* (N) -log2 of opacity times temporal opacity,
                           * >= -3 */
} saga_splat_posed;

/* A primitive in one camera. q = q0 + s + square s^2, s = v^2 + w^2 with
 * v = g dx - n dy and w = h dy, (dx, dy) from the mean to the pixel's
 * centre. */
typedef struct saga_splat_2d {
    real mean[2];         /* pixels */
    real g, n, h;         /* Cholesky factor of the conic, log2 units */
    real q0;              /* in [-3, cut) */
    real colour[3];
    real depth;           /* z */
    int16_t x0, y0, x1, y1; /* pixels touched lie in [x0, x1) x [y0, y1);
                           * empty: not visible */
} saga_splat_2d;

/* A record is what the pixels of a tile say about a splat: sums over them of
 * dL/dq / ln 2; of dL/ds / ln 2 times v, v dx, v dy, dy, dy^2; of dL/dC alpha
 * T; of alpha T. */
enum {
    SAGA_SUM_Q, SAGA_SUM_V, SAGA_SUM_VX, SAGA_SUM_VY, SAGA_SUM_Y, SAGA_SUM_YY,
    SAGA_SUM_R, SAGA_SUM_G, SAGA_SUM_B, SAGA_SUM_WEIGHT, SAGA_N_SUMS
};

/* A pair is an entry of a tile's list. */
typedef struct saga_splat_pair {
    uint32_t splat;       /* index of the primitive */
    uint32_t slot;        /* its record: slots of a splat are consecutive, in
                           * the order of its tiles */
} saga_splat_pair;

/* A forward pass leaves this for its backward pass; it grows as needed. */
typedef struct saga_splat_work {
    uint32_t n;           /* primitives: those given, then the canvas's own */
    uint32_t n_visible;
    uint32_t n_tiles_x, n_tiles_y;
    size_t n_pairs;
    saga_splat_posed posed;
    saga_splat_2d *splat;       /* (N) */
    real *extent;               /* (N) major half-axis, px; 0: not visible */
    uint32_t *order;            /* (n_visible) by (depth, index) */
    uint32_t *slot_begin;       /* (N + 1) of each primitive's records */
    saga_splat_pair *pair;      /* (n_pairs) tile by tile */
    size_t *tile_begin;         /* (tiles + 1) */
    real *record;               /* (n_pairs, SAGA_N_SUMS) by primitive, then
                                 * by tile */
    uint16_t *touched;          /* (n_pairs) blocks of the tile */
    void *kept;                 /* what each thread's tile keeps for backward */
    size_t n_kept;              /* threads there is room for */
    saga_splat_posed d_posed;
    void *scratch[3];
    double *squares;            /* (tiles) sums of squared errors */
    size_t cap[18];             /* bytes behind each other pointer */
} saga_splat_work;

typedef struct saga_canvas {
    saga_splat_camera camera;   /* set by the caller for each picture */
    real t;                     /* the same, in the primitives' unit of time */
    saga_splat_rules rules;
    const struct saga_splat_params *still; /* (n_still) primitives that every
                                 * pass draws with those it is given, in one
                                 * order of depth; they learn nothing */
    uint32_t n_still;           /* 0 at first */
    real *image;                /* as drawn */
    real *truth;                /* filled by the caller; below 0 where a pixel
                                 * does not count */
    size_t n_unseen;            /* number of such pixels */
    real *d_image;              /* dL/dimage */
    saga_splat_work splat;
} saga_canvas;

#define saga_canvas_init SAGA_REAL_NAME(saga_canvas_init)
#define saga_canvas_free SAGA_REAL_NAME(saga_canvas_free)
#define saga_canvas_n_seen SAGA_REAL_NAME(saga_canvas_n_seen)
#define saga_canvas_mse SAGA_REAL_NAME(saga_canvas_mse)
#define saga_canvas_grow SAGA_REAL_NAME(saga_canvas_grow)

/* Makes room for pictures of up to n_pixels, all of them black. Fails where
 * memory is short; saga_canvas_free then has nothing to do. */
bool saga_canvas_init(saga_canvas *canvas, size_t n_pixels,
                      saga_error *error);

/* Frees everything in it; a canvas of zeros has nothing. */
void saga_canvas_free(saga_canvas *canvas);

/* Returns how many samples of the picture count; 1 where none does. */
double saga_canvas_n_seen(const saga_canvas *canvas);

/* Returns the mean squared error of image, clipped to 0..1, against truth. */
double saga_canvas_mse(const saga_canvas *canvas);

/* For the passes: makes *p hold at least nbytes; the old content is lost when
 * it grows. */
bool saga_canvas_grow(void **p, size_t *cap, size_t nbytes,
                      saga_error *error);

#endif
