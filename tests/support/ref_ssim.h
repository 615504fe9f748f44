/* SPDX-License-Identifier: MIT
 *
 * SSIM by its definition, in double: 121 taps per pixel, zeros outside.
 */
#ifndef REF_SSIM_H
#define REF_SSIM_H

/* Mean over the pixels of one channel (H, W). */
double ref_ssim(const double *x, const double *y, int width, int height);

#endif
