/* SPDX-License-Identifier: MIT
 *
 * The differentiable rasteriser: primitives -> at a time -> in a camera ->
 * pictures, and the gradients back. The float twin of decoder/animate.*,
 * project.* and raster.*, with the norm's rules and constants.
 *
 * Conventions
 * - Tensors are points-major and dense: (N, 3) is x, y, z of primitive 0, of
 *   primitive 1, ... Pictures are planar: (3, H, W).
 * - Units are the caller's: one unit of length for means, supports, log2_scale
 *   and the camera; one unit of time for t, t_centre, log2_width, and the
 *   motion and slope per unit of time. Pixels: (0, 0) is the corner of the
 *   picture, centres lie at +1/2.
 * - x_backward ADDS to the gradients it is given; the caller clears them.
 * - Results have the same bits for any number of threads: every sum has a
 *   fixed order, and no partition shows.
 * - Functions that allocate return 0, or -1 when memory is short; the work
 *   area is then still valid, its content undefined.
 */
#ifndef SAGA_SPLAT_H
#define SAGA_SPLAT_H

#include "real.h"

#include <stddef.h>
#include <stdint.h>

/* Primitives, their gradients, or anything else of the same shape. */
typedef struct saga_splat_params {
    real *mean;       /* (N, 3) at t = t_centre */
    real *quat;       /* (N, 4) w, x, y, z; any length; (0, 0, 0, 0) counts as
                       * (1, 0, 0, 0) */
    real *log2_scale; /* (N, 3) standard deviations; used within +-60 */
    real *opacity;    /* (N) logit in log2 units: alpha = 1 / (1 + 2^-o) */
    real *colour;     /* (N, 3) R, G, B, in [0, 1] */
    real *support;    /* (N, 3) unit of the motion; NULL: 1 */
    real *motion;     /* (N, 9) order 1 x, y, z; order 2; order 3; in supports
                       * per time^order; NULL: none */
    real *slope;      /* (N, 4) of the quaternion per time; NULL: none */
    real *t_centre;   /* (N); NULL: 0 */
    real *log2_width; /* (N) temporal width; NULL: no temporal opacity */
} saga_splat_params;

/* Primitives at one time. */
typedef struct saga_splat_posed {
    real *mean;       /* (N, 3) */
    real *quat;       /* (N, 4) not normalised */
    real *q0;         /* (N) -log2 of opacity times temporal opacity, >= 0 */
} saga_splat_posed;

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

/* The norm's constants, which only tests change: finite differences are wrong
 * wherever a pixel crosses the cut or the floor. */
typedef struct saga_splat_rules {
    real cut;             /* a splat touches pixels with q < cut */
    real alpha_cap;
    real t_floor;         /* a pixel is finished below it */
    int detach_time;      /* 1: no gradient to t_centre through motion and
                           * slope, as STG does */
} saga_splat_rules;

/* A primitive in one camera. q = q0 + v^2 + w^2 with v = g dx - n dy and
 * w = h dy, (dx, dy) from the mean to the pixel's centre. */
typedef struct saga_splat_2d {
    real mean[2];         /* pixels */
    real g, n, h;         /* Cholesky factor of the conic, log2 units */
    real q0;              /* in [0, cut) */
    real colour[3];
    real depth;           /* z */
    int16_t x0, y0, x1, y1; /* pixels touched lie in [x0, x1) x [y0, y1);
                           * empty: not visible */
} saga_splat_2d;

/* For growing and pruning; every call of saga_splat_backward adds. NULL
 * members are left out. */
typedef struct saga_splat_stats {
    real *grad2d;         /* (N) += |dL / d 2-D mean|, per pixel */
    real *weight;         /* (N) += blending weights alpha T over the pixels */
    real *radius;         /* (N) max= major half-axis of what is drawn, px */
    uint32_t *seen;       /* (N) += 1 if it may touch a pixel */
} saga_splat_stats;

/* One (splat, tile): what the pixels of a tile say about a splat, sums over
 * them of dL/dq / ln 2 times 1, v, v dx, v dy, dy, dy^2; of dL/dC alpha T; of
 * alpha T. */
enum {
    SAGA_SUM_1, SAGA_SUM_V, SAGA_SUM_VX, SAGA_SUM_VY, SAGA_SUM_Y, SAGA_SUM_YY,
    SAGA_SUM_R, SAGA_SUM_G, SAGA_SUM_B, SAGA_SUM_WEIGHT, SAGA_N_SUMS
};

/* An entry of a tile's list. */
typedef struct saga_splat_pair {
    uint32_t splat;       /* index of the primitive */
    uint32_t slot;        /* its record: slots of a splat are consecutive, in
                           * the order of its tiles */
} saga_splat_pair;

/* What a forward pass leaves for its backward pass. Zero it before the first
 * use, saga_splat_free at the end; it grows as needed. */
typedef struct saga_splat_work {
    uint32_t n;           /* primitives */
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
    saga_splat_posed d_posed;
    void *scratch[4];
    size_t cap[16];             /* bytes behind each pointer */
} saga_splat_work;

#define saga_splat_rules_default SAGA_REAL_NAME(saga_splat_rules_default)
#define saga_splat_free SAGA_REAL_NAME(saga_splat_free)
#define saga_splat_grow SAGA_REAL_NAME(saga_splat_grow)
#define saga_splat_forward SAGA_REAL_NAME(saga_splat_forward)
#define saga_splat_backward SAGA_REAL_NAME(saga_splat_backward)

void saga_splat_rules_default(saga_splat_rules *r);
void saga_splat_free(saga_splat_work *w);

/* Makes *p hold at least nbytes; the old content is lost when it grows. */
int saga_splat_grow(void **p, size_t *cap, size_t nbytes);

/* The whole chain: draws primitives p[0..n) at time t.
 * image (3, H, W) and trans (H, W), the transmittance left at each pixel, are
 * overwritten. n < 2^31, n = 0 included. Returns 0, or -1 without memory. */
int saga_splat_forward(real *image, real *trans, saga_splat_work *work,
                       const saga_splat_params *p, uint32_t n, real t,
                       const saga_splat_camera *cam,
                       const saga_splat_rules *rules);

/* Adds to d the gradients of the same forward pass, given dL/dimage (3, H, W)
 * and dL/dtrans (H, W; NULL: 0). image and trans are what it left. Members of
 * d that are NULL are not computed, except mean, quat, log2_scale, opacity and
 * colour, which must be there. stats may be NULL. (d->colour[0] of a pass with
 * d_image = (error, 0, 0) is a primitive's share of an error map.) */
int saga_splat_backward(saga_splat_params *d, saga_splat_stats *stats,
                        saga_splat_work *work, const real *d_image,
                        const real *d_trans, const real *image,
                        const real *trans, const saga_splat_params *p, real t,
                        const saga_splat_camera *cam,
                        const saga_splat_rules *rules);

#endif
