/* SPDX-License-Identifier: MIT
 *
 * Measures pictures in luma and chroma, as is usual for video: PSNR of each;
 * WS-PSNR for equirectangular pictures; and IV-PSNR, which tolerates what does
 * not disturb in a synthesised view, namely shifts of up to two pixels and a
 * small difference of colour over the whole picture.
 *
 * Pictures are converted to 8-bit full-range YCbCr 4:4:4 by BT.709.
 */
#ifndef SAGA_YUV_H
#define SAGA_YUV_H

#include "metrics.h"

/* One picture's planes. They share one allocation: release y with free(). */
typedef struct saga_yuv {
    int width, height;
    uint8_t *y, *u, *v; /* (height, width) each */
} saga_yuv;

bool saga_yuv_of(saga_yuv *yuv, const uint8_t *rgb, int width, int height,
                 saga_error *error);

/* Results, in dB. Equal planes have an infinite PSNR, except in IV-PSNR, where
 * a sum of squares is at least 1. */
typedef struct saga_yuv_score {
    double psnr[3], psnr_yuv;
    double ws_psnr; /* WS-PSNR of Y; equals psnr[0] unless equirect */
    double iv_psnr;
} saga_yuv_score;

/* Compares a, the decoded picture, with b, the truth. With `equirect` the rows
 * go from pole to pole, and WS- and IV-PSNR weight each row by its length on
 * the sphere. IV-PSNR takes most of the time; it is NaN unless `iv`. */
bool saga_yuv_compare(saga_yuv_score *score, const saga_picture_pair *pair,
                      bool equirect, bool iv, saga_error *error);

#endif
