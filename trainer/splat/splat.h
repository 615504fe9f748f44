/* SPDX-License-Identifier: MIT
 *
 * The differentiable rasteriser goes primitives -> at a time -> in a camera ->
 * pictures, and back with the gradients. The float twin of decoder/animate.*,
 * project.* and raster.*, with the norm's rules and constants.
 *
 * Conventions
 * - Tensors are points-major and dense: (N, 3) is x, y, z of primitive 0, of
 *   primitive 1, ...
 * - Units are the caller's: one unit of length for means, supports, log2_scale
 *   and the camera; one unit of time, the segment, for t, t_centre and
 *   log2_width. Motion and slope go by age: dt over the temporal width, or over
 *   half a unit where that is shorter or there is no width.
 * - x_backward ADDS to the gradients it is given; the caller clears them.
 * - Results have the same bits for any number of threads: every sum has a
 *   fixed order, and no partition shows.
 * - Functions that can fail do so where memory is short; the canvas is then
 *   still valid, its content undefined.
 */
#ifndef SAGA_SPLAT_H
#define SAGA_SPLAT_H

#include "attributes.h"
#include "canvas.h"
#include "threads.h"

/* Growing and pruning use these; every call of saga_splat_backward adds. NULL
 * members are left out. */
typedef struct saga_splat_stats {
    real *grad2d;         /* (N) += |dL / d 2-D mean|, per pixel */
    real *weight;         /* (N) += blending weights alpha T over the pixels */
    uint32_t *seen;       /* (N) += 1 if it may touch a pixel */
} saga_splat_stats;

#define saga_splat_forward SAGA_REAL_NAME(saga_splat_forward)
#define saga_splat_backward SAGA_REAL_NAME(saga_splat_backward)
#define saga_splat_learn SAGA_REAL_NAME(saga_splat_learn)

/* A picture teaches this. */
typedef struct saga_splat_learning {
    double mse;           /* out: mean of (image - truth)^2, not clipped */
    saga_splat_params d;  /* gradients, as saga_splat_backward's */
    saga_splat_stats *stats; /* the same; may be NULL */
} saga_splat_learning;

/* Draws primitives p[0..n) at canvas->t into canvas->image, which is
 * overwritten, together with canvas->still. n and n_still together < 2^31, 0
 * included. */
bool saga_splat_forward(saga_canvas *canvas, const saga_splat_params *p,
                        uint32_t n, saga_error *error);

/* Adds to d the gradients of the same forward pass, given canvas->d_image.
 * Members of d that are NULL are not computed, except mean, quat, log2_scale,
 * opacity and colour, which must be there. stats may be NULL. (d->colour[0] of
 * a pass with d_image = (error, 0, 0) is a primitive's share of an error map.)
 */
bool saga_splat_backward(saga_splat_params *d, saga_splat_stats *stats,
                         saga_canvas *canvas, const saga_splat_params *p,
                         saga_error *error);

/* Does both at once, where the loss is the mean squared error against
 * canvas->truth: what training minimises, since PSNR measures it. Leaves
 * canvas->image and d_image as they were. */
bool saga_splat_learn(saga_splat_learning *learning, saga_canvas *canvas,
                      const saga_splat_params *p, uint32_t n,
                      saga_error *error);

#endif
