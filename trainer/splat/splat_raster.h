/* SPDX-License-Identifier: MIT
 *
 * Blends the tiles' lists front to back, and differentiates it. The rules are
 * the decoder's: a splat touches the pixels with q < cut, alpha = 2^-q capped,
 * w = alpha T, a pixel is finished once its T fell below the floor, and what
 * is left shows the background.
 */
#ifndef SAGA_SPLAT_RASTER_H
#define SAGA_SPLAT_RASTER_H

#include "splat.h"

#define saga_splat_raster_reserve SAGA_REAL_NAME(saga_splat_raster_reserve)
#define saga_splat_raster_forward SAGA_REAL_NAME(saga_splat_raster_forward)
#define saga_splat_raster_backward SAGA_REAL_NAME(saga_splat_raster_backward)
#define saga_splat_raster_learn SAGA_REAL_NAME(saga_splat_raster_learn)

/* Draws canvas->splat's splats and lists into canvas->image. */
void saga_splat_raster_forward(saga_canvas *canvas);

/* Takes memory for a backward pass over the same lists, with as many threads as
 * there may be now. */
bool saga_splat_raster_reserve(saga_canvas *canvas, saga_error *error);

/* SETS canvas->splat.record[n_pairs][SAGA_N_SUMS], every one of them, given
 * canvas->d_image. */
void saga_splat_raster_backward(saga_canvas *canvas);

/* Does the same where the loss is the mean of (image - truth)^2, which it
 * returns: forward, loss and backward of a tile in one visit. Neither image nor
 * d_image is read or written. */
double saga_splat_raster_learn(saga_canvas *canvas);

#endif
