/* SPDX-License-Identifier: MIT
 *
 * This measures how far two pictures are from each other.
 *
 * Conventions. Pictures are 8-bit RGB rows without padding, as a viewer gets
 * them: clipped and rounded. Sums are taken in double, rows in order, so that
 * the result does not depend on the number of threads. A metric of a set of
 * pictures is the mean of the pictures' own values; only psnr_of_mean goes
 * over the mean of the squared errors.
 */
#ifndef SAGA_METRICS_H
#define SAGA_METRICS_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

/* Reports name the variants so. */
#define SAGA_PSNR_TEXT "8-bit RGB, mean of the pictures' values"
#define SAGA_PSNR_OF_MEAN_TEXT "8-bit RGB, of the mean squared error of all"
#define SAGA_SSIM_ZERO_TEXT \
    "11x11 Gaussian, sigma 1.5, RGB, zero padding, borders count"
#define SAGA_SSIM_VALID_TEXT \
    "11x11 Gaussian, sigma 1.5, RGB, windows inside the picture only"
#define SAGA_MS_SSIM_TEXT \
    "5 scales (Wang 2003), windows inside, 2x2 mean, per channel"

enum {
    SAGA_SSIM_WINDOW = 11,
    SAGA_MS_SSIM_SCALES = 5,
    SAGA_MS_SSIM_MIN = 161     /* least side: the window at the last scale */
};

/* A pair is two pictures to be compared. */
typedef struct saga_picture_pair {
    const uint8_t *a, *b;    /* (height, width, 3) */
    int width, height;
    int n_threads;           /* to do it with, >= 1 */
} saga_picture_pair;

/* One pair of pictures scores this. */
typedef struct saga_score {
    double mse;              /* of 8-bit samples */
    double psnr;             /* dB; infinity for equal pictures */
    double psnr_of_mean;     /* of a set: of its mean mse; of one: psnr */
    double ssim_zero, ssim_valid;
    double ms_ssim;          /* NaN when a side is below SAGA_MS_SSIM_MIN */
    double psnr_y, psnr_u, psnr_v, psnr_yuv; /* yuv.h has these, */
    double ws_psnr, iv_psnr; /* and these */
    double lpips;            /* and lpips.h this; NaN: not measured */
} saga_score;

/* Mean squared difference of n samples; 0 for n = 0. */
double saga_mse(const uint8_t *a, const uint8_t *b, size_t n);

/* Returns 10 log10(255^2 / mse), infinity for 0, NaN for NaN. */
double saga_psnr(double mse);

/* Computes both SSIMs of two pictures; valid is NaN when a side is below 11.
 * False: no memory. */
bool saga_ssim(double *zero, double *valid, const saga_picture_pair *pair,
               saga_error *error);

/* Finds MS-SSIM: the product of the mean contrast-structure terms (negative
 * means count as 0) of scales 1 to 4 and the mean SSIM of scale 5, to Wang's
 * powers. A scale's picture is the 2x2 mean of the one before; the last row or
 * column of an odd side is repeated. NaN when too small. False: no memory. */
bool saga_ms_ssim(double *value, const saga_picture_pair *pair,
                  saga_error *error);

/* Computes the squared error and PSNR alone; the others are NaN. */
saga_score saga_score_psnr(const saga_picture_pair *of);

/* Computes all up to MS-SSIM; the others are NaN. */
bool saga_score_picture(saga_score *score, const saga_picture_pair *pair,
                        saga_error *error);

/* Mean of scores: zero a saga_score_sum, add, take the mean; of none, NaN. */
typedef struct saga_score_sum {
    saga_score sum;
    int n;
} saga_score_sum;

void saga_score_add(saga_score_sum *to, const saga_score *score);
saga_score saga_score_mean(const saga_score_sum *of);

#endif
