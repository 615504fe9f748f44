/* SPDX-License-Identifier: MIT
 *
 * What training minimises about a picture: L1 and SSIM. SSIM is the one of
 * 3DGS's loss: per channel, 11 x 11 Gaussian of sigma 1.5, zero padding,
 * C1 = 0.01^2, C2 = 0.03^2, mean over all pixels, borders included.
 */
#ifndef SAGA_PICTURE_LOSS_H
#define SAGA_PICTURE_LOSS_H

#include "canvas.h"

/* loss = l1 * mean |x - y| + dssim * (1 - mean SSIM) */
typedef struct saga_loss_weights { real l1, dssim; } saga_loss_weights;

typedef struct saga_picture_loss { double loss, l1, ssim, mse; }
    saga_picture_loss;

#define saga_loss_picture SAGA_REAL_NAME(saga_loss_picture)

/* What warm-up and fit minimise: the paper's
 * D = (1 - eta) L1 + eta (1 - SSIM) / 2, eta = 0.2. */
static inline saga_loss_weights saga_loss_paper(void)
{
    return (saga_loss_weights){ R(0.8), R(0.1) };
}

/* Compares image (3, H, W; the canvas's own, or a copy that was changed) with
 * canvas->truth and sets canvas->d_image to the loss's gradient. dssim = 0
 * leaves out the SSIM, which is then 0. The same bits for any number of
 * threads. Fails where memory is short. */
bool saga_loss_picture(saga_picture_loss *out, saga_canvas *canvas,
                       const real *image, const saga_loss_weights *weights,
                       saga_error *error);

#endif
