/* SPDX-License-Identifier: MIT
 *
 * What training minimises about a picture: L1 and SSIM. SSIM is the one of
 * 3DGS's loss: per channel, 11 x 11 Gaussian of sigma 1.5, zero padding,
 * C1 = 0.01^2, C2 = 0.03^2, mean over all pixels, borders included.
 */
#ifndef SAGA_PICTURE_LOSS_H
#define SAGA_PICTURE_LOSS_H

#include "real.h"

#include <stddef.h>

/* loss = l1 * mean |x - y| + dssim * (1 - mean SSIM) */
typedef struct saga_loss_weights { real l1, dssim; } saga_loss_weights;

typedef struct saga_picture_loss { double loss, l1, ssim, mse; }
    saga_picture_loss;

/* Memory of the loss; zero it before the first use, saga_loss_free at the
 * end. */
typedef struct saga_loss_work {
    real *strip;
    double *row;
    size_t cap[2];
} saga_loss_work;

#define saga_loss_free SAGA_REAL_NAME(saga_loss_free)
#define saga_loss_blur_truth SAGA_REAL_NAME(saga_loss_blur_truth)
#define saga_loss_picture SAGA_REAL_NAME(saga_loss_picture)

/* The paper's D = (1 - eta) L1 + eta (1 - SSIM) / 2; 3DGS's lacks the / 2. */
static inline saga_loss_weights saga_loss_paper(real eta)
{
    return (saga_loss_weights){ 1 - eta, eta / 2 };
}

static inline saga_loss_weights saga_loss_3dgs(real eta)
{
    return (saga_loss_weights){ 1 - eta, eta };
}

void saga_loss_free(saga_loss_work *work);

/* blurs (2, 3, H, W): the window's mean of y and of y^2, which saves a third
 * of the loss's blurs when a picture is used again. Returns 0 or -1. */
int saga_loss_blur_truth(real *blurs, saga_loss_work *work, const real *truth,
                         int width, int height);

/* image, truth (3, H, W). blurs: of truth, or NULL. d_image (3, H, W; NULL: not
 * wanted) is SET to the loss's gradient. dssim = 0 leaves out the SSIM, which
 * is then 0. The same bits for any number of threads, with blurs or without.
 * Returns 0, or -1 without memory. */
int saga_loss_picture(saga_picture_loss *out, real *d_image,
                      saga_loss_work *work, const real *image,
                      const real *truth, const real *blurs, int width,
                      int height, const saga_loss_weights *weights);

#endif
