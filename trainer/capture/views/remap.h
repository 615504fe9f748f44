/* SPDX-License-Identifier: MIT
 *
 * Goes from the picture a lens made to the picture a pinhole would have made,
 * and from full size to 1/N, in one pass with one rounding.
 *
 * Lens: OpenCV's models. With x, y the pinhole direction (z = 1), r2 = x x +
 * y y and g = 1 + k1 r2 + k2 r2^2 + k3 r2^3,
 *
 *     x' = x g + 2 p1 x y + p2 (r2 + 2 x x)
 *     y' = y g + p1 (r2 + 2 y y) + 2 p2 x y
 *     u  = fx x' + cx,   v = fy y' + cy,
 *
 * or of a fisheye, with the angle a from the axis, tan a = |x, y|,
 *
 *     (x', y') = (x, y) / |x, y| (a + k1 a^3 + k2 a^5 + k3 a^7 + k4 a^9).
 *
 * An equirectangular picture has fx, fy pixels a radian of longitude and
 * latitude around (cx, cy); one of its faces, a pinhole of 90 degrees square
 * with as many pixels a radian in its middle, looks in a direction of its own.
 * At the seam and the poles it takes the nearest pixel.
 *
 * Of other lenses the pinhole keeps the size and the principal point; both its
 * focal lengths are those of the lens times one factor, the smallest (widest
 * view) for which every pixel of the pinhole picture lies between pixel
 * centres of the source, and not wider than 110 degrees. So no pixel is invalid
 * and no mask is needed; what the lens saw beyond that is given up. A point in
 * front of the camera and inside the pinhole picture is where u = fx X/Z + cx
 * says.
 *
 * Sampling: bilinear at full size (positions to 1/256 pixel), then N x N boxes
 * are averaged; rows and columns beyond a multiple of N are dropped at the
 * right and the bottom. Depth is never mixed: the nearest source sample.
 */
#ifndef SAGA_REMAP_H
#define SAGA_REMAP_H

#include "capture.h"

typedef struct saga_lens {
    double fx, fy, cx, cy;
    double k1, k2, k3, p1, p2;
    double k4;                /* of a fisheye, which has no p1 and p2 */
    bool fisheye, equirect;
    double turn[9];           /* of a face: rotation from its axes to those of
                               * the equirectangular picture, row-major */
} saga_lens;

typedef struct saga_remap {
    int original_width, original_height;
    int full_width, full_height; /* size of the pinhole picture before
                                  * scaling */
    int scale;
    int width, height;        /* size of the output */
    double fx, fy, cx, cy;    /* intrinsics of the output, in its pixels */
    double focal_scale;
    uint32_t *taps;           /* (full_height, full_width): index of the upper
                               * left of the four source pixels; NULL: no
                               * distortion */
    uint8_t *fractions;       /* (full_height, full_width, 2), in 1/256 pixel */
} saga_remap;

/* Computes the pixel at which the lens shows direction (x, y, 1). */
void saga_lens_project(const saga_lens *lens, double x, double y,
                       double uv[2]);
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
