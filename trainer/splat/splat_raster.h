/* SPDX-License-Identifier: MIT
 *
 * Blending the tiles' lists front to back, and its derivative. The rules are
 * the decoder's: a splat touches the pixels with q < cut, alpha = 2^-q capped,
 * w = alpha T, a pixel is finished once its T fell below the floor, and what
 * is left shows the background.
 */
#ifndef SAGA_SPLAT_RASTER_H
#define SAGA_SPLAT_RASTER_H

#include "splat.h"

#define saga_splat_raster_forward SAGA_REAL_NAME(saga_splat_raster_forward)
#define saga_splat_raster_backward SAGA_REAL_NAME(saga_splat_raster_backward)

/* work holds splats and lists. image (3, H, W), trans (H, W). */
void saga_splat_raster_forward(real *image, real *trans,
                               const saga_splat_work *work,
                               const saga_splat_camera *cam,
                               const saga_splat_rules *rules);

/* SETS record[n_pairs][SAGA_N_SUMS], every one of them. d_trans: NULL is 0. */
void saga_splat_raster_backward(real *record, const saga_splat_work *work,
                                const real *d_image, const real *d_trans,
                                const real *image, const real *trans,
                                const saga_splat_camera *cam,
                                const saga_splat_rules *rules);

#endif
