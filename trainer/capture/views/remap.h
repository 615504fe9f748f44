/* SPDX-License-Identifier: MIT
 *
 * Resamples a picture that was taken through a lens to the picture that a
 * pinhole camera would have taken, and reduces it to 1/N, in one pass with one
 * rounding.
 *
 * The lens models are OpenCV's. With the pinhole direction (x, y, 1), r2 = x x
 * + y y and g = 1 + k1 r2 + k2 r2^2 + k3 r2^3,
 *
 *     x' = x g + 2 p1 x y + p2 (r2 + 2 x x)
 *     y' = y g + p1 (r2 + 2 y y) + 2 p2 x y
 *     u  = fx x' + cx,   v = fy y' + cy.
 *
 * For a fisheye lens, with the angle a from the axis, tan a = |x, y|,
 *
 *     (x', y') = (x, y) / |x, y| (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9).
 *
 * An equirectangular picture has fx, fy pixels per radian of longitude and
 * latitude around (cx, cy). It is resampled to faces: pinhole pictures of 90 x
 * 90 degrees with as many pixels per radian in their middle, each with a
 * direction of its own. At the seam and the poles a face takes the nearest
 * pixel.
 *
 * For the other lenses, the pinhole picture has the size and principal point of
 * the source. Its focal lengths are those of the lens times one factor, the
 * smallest (widest view) for which every pixel of the pinhole picture lies
 * between pixel centres of the source, and the view is at most 110 degrees
 * wide. So all pixels are valid and no mask is needed; what the lens saw
 * outside is lost. A point in front of the camera and inside of the pinhole
 * picture is at u = fx X/Z + cx, and v likewise.
 *
 * Sampling is bilinear at full size (positions to 1/256 pixel); then boxes of N
 * x N pixels are averaged, and rows and columns beyond a multiple of N are
 * dropped at the bottom and the right. Depths are not interpolated: the nearest
 * source sample is taken.
 */
#ifndef SAGA_REMAP_H
#define SAGA_REMAP_H

#include "capture.h"

typedef struct saga_lens {
    double fx, fy, cx, cy;
    double k1, k2, k3, p1, p2;
    double k4; /* coefficient of a fisheye, which has no p1 and
                * p2 */
    bool fisheye, equirect;
    double turn[9]; /* rotation from a face's axes to those of the
                     * equirectangular picture, row-major */
} saga_lens;

typedef struct saga_remap {
    int original_width, original_height;
    int full_width, full_height; /* size of the pinhole picture before
                                  * scaling */
    int scale;
    int width, height;     /* size of the output */
    double fx, fy, cx, cy; /* intrinsics of the output, in its pixels */
    double focal_scale;
    uint32_t *taps;     /* (full_height, full_width): index of the upper
                         * left of the four source pixels; NULL: no
                         * distortion */
    uint8_t *fractions; /* (full_height, full_width, 2), in 1/256 pixel */
} saga_remap;

/* Computes the pixel at which the lens shows direction (x, y, 1). */
void saga_lens_project(const saga_lens *lens, double x, double y, double uv[2]);
bool saga_lens_is_pinhole(const saga_lens *lens);

/* Chooses the pinhole picture; allocates nothing. `file` is the name for
 * messages. */
bool saga_remap_plan(saga_remap *remap, const saga_lens *lens, int width,
                     int height, int scale, const char *file,
                     saga_error *error);
/* Returns the number of bytes that saga_remap_build will allocate. */
uint64_t saga_remap_nbytes(const saga_remap *remap, const saga_lens *lens);
bool saga_remap_build(saga_remap *remap, const saga_lens *lens,
                      const char *file, saga_error *error);
void saga_remap_free(saga_remap *remap);

void saga_remap_rgb(const saga_remap *remap, const uint8_t *source,
                    uint8_t *rgb);
void saga_remap_depth(const saga_remap *remap, const float *source,
                      float *depth);

#endif
