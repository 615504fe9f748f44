/* SPDX-License-Identifier: MIT
 *
 * Measures pictures in luma and chroma, as video people do: PSNR of each,
 * WS-PSNR for pictures all round, and IV-PSNR, which forgives what does not
 * disturb in a view drawn from others: shifts of up to two pixels and a small
 * difference of colour all over the picture.
 *
 * Pictures become 8-bit YCbCr of full range by BT.709, not subsampled.
 */
#ifndef SAGA_YUV_H
#define SAGA_YUV_H

#include "metrics.h"

/* One picture's samples; free() frees y, which holds all three. */
typedef struct saga_yuv {
    int width, height;
    uint8_t *y, *u, *v;      /* (height, width) each */
} saga_yuv;

bool saga_yuv_of(saga_yuv *yuv, const uint8_t *rgb, int width, int height,
                 saga_error *error);

/* The metrics' result; equal planes have infinite PSNRs, but in IV-PSNR a sum
 * of squares is 1 at least. */
typedef struct saga_yuv_score {
    double psnr[3], psnr_yuv;
    double ws_psnr;          /* Y; the PSNR where rows weigh the same */
    double iv_psnr;
} saga_yuv_score;

/* Compares a, what was made, with b, the truth. With `equirect` the pictures'
 * rows go from pole to pole, and WS- and IV-PSNR weigh them by their lengths on
 * the sphere. Without `iv` that one, which takes the time, is NaN. */
bool saga_yuv_compare(saga_yuv_score *score, const saga_picture_pair *pair,
                      bool equirect, bool iv, saga_error *error);

#endif
