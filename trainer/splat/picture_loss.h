/* SPDX-License-Identifier: MIT
 *
 * What training minimises about a picture: the mean squared error of its
 * values, which PSNR measures. The paper's L1 and SSIM cost more and gain
 * nothing by it (docs/lab/objective.md).
 */
#ifndef SAGA_PICTURE_LOSS_H
#define SAGA_PICTURE_LOSS_H

#include "canvas.h"

#define saga_loss_picture SAGA_REAL_NAME(saga_loss_picture)

/* The mean of (image - truth)^2 over the canvas, values not clipped; sets
 * canvas->d_image to its gradient. The same bits for any number of threads. */
double saga_loss_picture(saga_canvas *canvas);

#endif
