/* SPDX-License-Identifier: MIT
 *
 * A canvas is a picture that is being drawn: its camera and time, what was
 * drawn, what should have been drawn, the gradient of their difference, and the
 * work memory of the passes. Each user has one canvas, large enough for its
 * largest picture.
 *
 * Pictures are planar, (3, H, W) by canvas->camera, with values 0..1. Pixel
 * coordinates have (0, 0) at the corner of the picture, so pixel centres are at
 * +1/2.
 */
#ifndef SAGA_CANVAS_H
#define SAGA_CANVAS_H

#include "error.h"
#include "real.h"
#include "rng.h"

#include <stddef.h>
#include <stdint.h>

/* A pinhole camera with x right, y down, z forward. */
typedef struct saga_splat_camera {
    real rotation[9];  /* rows: the camera's axes in scene axes */
    real centre[3];    /* in scene units */
    real focal[2];     /* in pixels, > 0 */
    real principal[2]; /* in pixels */
    real near_plane;   /* > 0 */
    int width, height; /* 1..16384 */
    real background[3];
} saga_splat_camera;

/* The constants of docs/arithmetic.md, set by saga_canvas_init. Only tests
 * change them, because finite differences are wrong where a pixel crosses the
 * cut or the floor. */
typedef struct saga_splat_rules {
    real cut; /* a splat touches the pixels with q < cut */
    real alpha_cap;
    real t_floor;    /* a pixel with less transmittance is finished */
    real low_pass;   /* pixels^2, added to the 2-D covariance */
    real square;     /* factor of s^2 in q: 0 by default, 1/2 for steep
                      * splats */
    int detach_time; /* 1: t_centre and log2_width get no gradient through
                      * motion and slope; default 0 */
    int order;       /* motions of higher orders get no gradient; default 3 */
} saga_splat_rules;

/* Primitives at one time. */
typedef struct saga_splat_posed {
    real *mean; /* (N, 3) */
    real *quat; /* (N, 4) not normalised */
    real *q0;   /* (N) -log2 of opacity times temporal opacity, >=
                 * -3 */
} saga_splat_posed;

/* A primitive as seen by a camera. At a pixel, q = q0 + s + square s^2 with
 * s = v^2 + w^2, v = g dx - n dy and w = h dy, where (dx, dy) is from the mean
 * to the pixel's centre. */
typedef struct saga_splat_2d {
    real mean[2]; /* in pixels */
    real g, n, h; /* Cholesky factor of the conic, log2 units */
    real q0;      /* in [-3, cut) */
    real colour[3];
    real depth;             /* z */
    int16_t x0, y0, x1, y1; /* the pixels touched are in [x0, x1) x [y0, y1);
                             * empty: not visible */
} saga_splat_2d;

/* A record holds the sums, over the pixels of a tile, that give a splat's
 * gradients: of dL/dq / ln 2; of dL/ds / ln 2 times v, v dx, v dy, dy and dy^2;
 * of dL/dC alpha T; and of alpha T. */
enum {
    SAGA_SUM_Q,
    SAGA_SUM_V,
    SAGA_SUM_VX,
    SAGA_SUM_VY,
    SAGA_SUM_Y,
    SAGA_SUM_YY,
    SAGA_SUM_R,
    SAGA_SUM_G,
    SAGA_SUM_B,
    SAGA_SUM_WEIGHT,
    SAGA_N_SUMS
};

/* A pair is an entry in the list of a tile. */
typedef struct saga_splat_pair {
    uint32_t splat; /* index of the primitive */
    uint32_t slot;  /* its record; the slots of a splat are consecutive,
                     * in the order of its tiles */
} saga_splat_pair;

/* The results of a forward pass, for its backward pass. It grows as needed. */
typedef struct saga_splat_work {
    uint32_t n; /* number of primitives: those of the pass, then the
                 * canvas's own */
    uint32_t n_visible;
    uint32_t n_tiles_x, n_tiles_y;
    size_t n_pairs;
    saga_splat_posed posed;
    saga_splat_2d *splat;  /* (N) splats */
    real *extent;          /* (N) major half-axis in pixels; 0: not
                            * visible */
    uint32_t *order;       /* (n_visible) primitives sorted by (depth,
                            * index) */
    uint32_t *slot_begin;  /* (N + 1) first record of each primitive */
    saga_splat_pair *pair; /* (n_pairs) one tile after the other */
    size_t *tile_begin;    /* (tiles + 1) */
    real *record;          /* (n_pairs, SAGA_N_SUMS) by primitive, then by
                            * tile */
    uint16_t *touched;     /* (n_pairs) bit mask of the tile's blocks */
    void *kept;            /* what the tile of each thread keeps for its
                            * backward pass */
    size_t n_kept;         /* number of threads with room in kept */
    saga_splat_posed d_posed;
    void *scratch[3];
    double *squares; /* (tiles) sum of squared errors of each tile */
    size_t cap[18];  /* bytes allocated for each pointer above */
} saga_splat_work;

typedef struct saga_canvas {
    saga_splat_camera camera; /* set by the caller for each picture */
    real t;                   /* time in the primitives' unit, set by the
                               * caller as well */
    saga_splat_rules rules;
    const struct saga_splat_params *still; /* (n_still) primitives that every
                                            * pass draws together with its own,
                                            * in one depth order, and that get
                                            * no gradients; not owned */
    uint32_t n_still;                      /* 0 by default */
    real *image;                           /* the drawn picture */
    real *truth;     /* set by the caller; < 0 where a pixel does not
                      * count */
    size_t n_unseen; /* number of pixels that do not count */
    real *d_image;   /* dL/dimage */
    saga_splat_work splat;
} saga_canvas;

#define saga_canvas_init SAGA_REAL_NAME(saga_canvas_init)
#define saga_canvas_free SAGA_REAL_NAME(saga_canvas_free)
#define saga_canvas_n_seen SAGA_REAL_NAME(saga_canvas_n_seen)
#define saga_canvas_mse SAGA_REAL_NAME(saga_canvas_mse)
#define saga_canvas_draw_signs SAGA_REAL_NAME(saga_canvas_draw_signs)
#define saga_canvas_grow SAGA_REAL_NAME(saga_canvas_grow)

/* Allocates pictures of up to n_pixels pixels, initially black. Returns false
 * with *error set, and nothing to free, if memory is short. */
bool saga_canvas_init(saga_canvas *canvas, size_t n_pixels, saga_error *error);

/* Frees everything in the canvas, which may be all zero. */
void saga_canvas_free(saga_canvas *canvas);

/* Returns the number of samples (3 for each pixel) that count, at least 1. */
double saga_canvas_n_seen(const saga_canvas *canvas);

/* Returns the mean squared error of the image, clipped to 0..1, against the
 * truth. */
double saga_canvas_mse(const saga_canvas *canvas);

/* Sets d_image to random signs, by the numbers of a stream from `first` on. If
 * sign s_p takes the place of dL / d value p, the gradient of an attribute is
 * g = sum_p s_p J_p. The signs are independent, hence the mean of g^2 is
 * sum_p J_p^2. */
void saga_canvas_draw_signs(saga_canvas *canvas, saga_rng rng, uint64_t first);

/* For the passes: makes *p hold at least nbytes bytes. When it grows, the old
 * content is lost. Returns false with *error set if memory is short. */
bool saga_canvas_grow(void **p, size_t *cap, size_t nbytes, saga_error *error);

#endif
