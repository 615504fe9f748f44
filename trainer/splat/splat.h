/* SPDX-License-Identifier: MIT
 *
 * The differentiable rasteriser draws primitives at a time in a camera, and
 * takes gradients of the picture back to them. It is the float twin of
 * decoder/animate.*, project.* and raster.*, with the rules and constants of
 * docs/arithmetic.md.
 *
 * Conventions
 * - Tensors are points-major and dense: (N, 3) is x, y, z of primitive 0, then
 *   of primitive 1, ...
 * - Units are chosen by the caller: one unit of length for means, supports,
 *   log2_scale and the camera; one unit of time, the segment, for t, t_centre
 *   and log2_width. Motion and slope depend on the age: dt over the temporal
 *   width, or over half a unit if that is shorter or there is no width.
 * - x_backward ADDS to the gradients it is given; the caller clears them.
 * - Results have the same bits for any number of threads: every sum has a
 *   fixed order that does not depend on how work is divided.
 * - Functions that can fail do so if memory is short; the canvas is then still
 *   valid, and its content undefined.
 */
#ifndef SAGA_SPLAT_H
#define SAGA_SPLAT_H

#include "attributes.h"
#include "canvas.h"
#include "threads.h"

/* Statistics for growing and pruning, to which every call of
 * saga_splat_backward adds. NULL members are skipped. */
typedef struct saga_splat_stats {
    real *grad2d;   /* (N) += |dL / d 2-D mean|, per pixel */
    real *weight;   /* (N) += blending weights alpha T over the pixels */
    uint32_t *seen; /* (N) += 1 for each picture that it may touch */
} saga_splat_stats;

#define saga_splat_forward SAGA_REAL_NAME(saga_splat_forward)
#define saga_splat_backward SAGA_REAL_NAME(saga_splat_backward)
#define saga_splat_learn SAGA_REAL_NAME(saga_splat_learn)

/* The results of saga_splat_learn. */
typedef struct saga_splat_learning {
    double mse;              /* set to the mean of (image - truth)^2, not
                              * clipped */
    saga_splat_params d;     /* gradients, added to as by saga_splat_backward */
    saga_splat_stats *stats; /* added to as well, or NULL */
} saga_splat_learning;

/* Draws primitives p[0..n), together with canvas->still, at canvas->t into
 * canvas->image. n + n_still < 2^31; both may be 0. */
bool saga_splat_forward(saga_canvas *canvas, const saga_splat_params *p,
                        uint32_t n, saga_error *error);

/* Adds the gradients of the last forward pass to d, from canvas->d_image.
 * Members of d that are NULL are skipped; mean, quat, log2_scale, opacity and
 * colour must not be NULL. stats may be NULL. (After a pass with
 * d_image = (error, 0, 0), d->colour[0] is the share of each primitive in a map
 * of errors.) */
bool saga_splat_backward(saga_splat_params *d, saga_splat_stats *stats,
                         saga_canvas *canvas, const saga_splat_params *p,
                         saga_error *error);

/* Draws and computes the gradients in one pass, for the mean squared error
 * against canvas->truth. Training minimises this error, because PSNR measures
 * it. canvas->image and d_image stay unchanged. */
bool saga_splat_learn(saga_splat_learning *learning, saga_canvas *canvas,
                      const saga_splat_params *p, uint32_t n,
                      saga_error *error);

#endif
