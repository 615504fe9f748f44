/* SPDX-License-Identifier: MIT
 *
 * SSIM by its definition, in double: 121 taps for each pixel, zeros outside.
 */
#ifndef REF_SSIM_H
#define REF_SSIM_H

/* Returns the mean over the pixels of one channel (H, W). */
double ref_ssim(const double *x, const double *y, int width, int height);

#endif
