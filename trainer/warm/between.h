/* SPDX-License-Identifier: MIT
 *
 * Predicts how good pictures are from between the cameras, where nobody filmed.
 * Small models of one moment are trained without some of the cameras. The
 * squared error of a camera that was left out exceeds its error in the models
 * that saw it, because without it the geometry is less well known. This excess
 * hardly depends on the size of a model, so it is added to the error that the
 * finished film has at its cameras (docs/lab/volume.md).
 */
#ifndef SAGA_BETWEEN_H
#define SAGA_BETWEEN_H

#include "capture.h"

typedef struct saga_between {
    double psnr; /* dB, as of a picture from a place whose neighbours are
                  * as far away as those of a camera; NaN: unknown */
    int n_views; /* number of cameras that were left out; 0: none that
                  * shows anything stands between others */
} saga_between;

/* Returns the time of a prediction, in pixels that are drawn and learned. */
double saga_between_work(const saga_capture *capture);

/* Predicts the PSNR between the cameras of a film that has the PSNR at_cameras
 * at those it was trained on. exposure (views, 3) has the factors with which
 * they are trained. Returns false with *error set if memory is short. */
bool saga_between_predict(saga_between *out, const saga_capture *capture,
                          const double *exposure, double at_cameras,
                          uint64_t seed, saga_error *error);

#endif
