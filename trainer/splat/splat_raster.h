/* SPDX-License-Identifier: MIT
 *
 * Blends the lists of the tiles front to back, and computes the gradients. The
 * rules are the decoder's: a splat touches the pixels with q < cut,
 * alpha = 2^-q is capped, its weight is alpha T, a pixel is finished when its T
 * falls below the floor, and the remaining T shows the background.
 */
#ifndef SAGA_SPLAT_RASTER_H
#define SAGA_SPLAT_RASTER_H

#include "isa.h"
#include "splat.h"

#define saga_splat_raster_reserve SAGA_ISA_NAME(saga_splat_raster_reserve)
#define saga_splat_raster_forward SAGA_ISA_NAME(saga_splat_raster_forward)
#define saga_splat_raster_backward SAGA_ISA_NAME(saga_splat_raster_backward)
#define saga_splat_raster_learn SAGA_ISA_NAME(saga_splat_raster_learn)

/* Draws the splats and lists of canvas->splat into canvas->image. */
extern void saga_splat_raster_forward(saga_canvas *canvas);

/* Allocates memory for a backward pass over the same lists, with the present
 * number of threads. Returns false with *error set if memory is short. */
extern bool saga_splat_raster_reserve(saga_canvas *canvas, saga_error *error);

/* SETS all of canvas->splat.record[n_pairs][SAGA_N_SUMS], from
 * canvas->d_image. */
extern void saga_splat_raster_backward(saga_canvas *canvas);

/* Sets the records like saga_splat_raster_backward, for the loss mean of (image
 * - truth)^2, and returns the loss. Each tile is drawn, compared and
 * differentiated in one visit. image and d_image are neither read nor
 * written. */
extern double saga_splat_raster_learn(saga_canvas *canvas);

#endif
