/* SPDX-License-Identifier: MIT
 *
 * Measures how far two pictures are from each other.
 *
 * Pictures are 8-bit RGB rows without padding, as a viewer gets them: clipped
 * and rounded. Sums are taken in double, row by row in order, so that the
 * result does not depend on the number of threads. score.h has the table of all
 * metrics and of their means.
 */
#ifndef SAGA_METRICS_H
#define SAGA_METRICS_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

enum {
    SAGA_SSIM_WINDOW = 11,
    SAGA_MS_SSIM_SCALES = 5,
    SAGA_MS_SSIM_MIN = 161 /* least side: at the last scale the window just
                            * fits */
};

/* A pair is two pictures to be compared. */
typedef struct saga_picture_pair {
    const uint8_t *a, *b; /* (height, width, 3) */
    int width, height;
    int n_threads; /* threads to use, >= 1 */
} saga_picture_pair;

/* Returns the mean squared difference of n samples; 0 for n = 0. */
double saga_mse(const uint8_t *a, const uint8_t *b, size_t n);

/* Returns 10 log10(255^2 / mse), infinity for 0, NaN for NaN. */
double saga_psnr(double mse);

/* Computes SSIM with zero padding and over the windows inside the pictures only
 * (valid), which is NaN if a side is below 11. Fails if memory is short. */
bool saga_ssim(double *zero, double *valid, const saga_picture_pair *pair,
               saga_error *error);

/* Computes MS-SSIM: the product of the mean contrast-structure terms (negative
 * means count as 0) of scales 1 to 4 and the mean SSIM of scale 5, each to
 * Wang's exponent. Each scale is the 2x2 mean of the scale before; the last row
 * or column of an odd side is repeated. The value is NaN if a side is below
 * SAGA_MS_SSIM_MIN. Fails if memory is short. */
bool saga_ms_ssim(double *value, const saga_picture_pair *pair,
                  saga_error *error);

#endif
