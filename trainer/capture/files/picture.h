/* SPDX-License-Identifier: MIT
 *
 * Still pictures are PNG (8 or 16 bits, grey, palette or colour; alpha over
 * black; gamma chunks are ignored, as video pipelines do), JPEG (of grey or
 * colour; turned by no EXIF note, since calibration was not either), OpenEXR
 * (scanlines; R G B are linear light and become 8-bit sRGB; Z is depth), and
 * through ffmpeg WebP and TIFF (alpha is dropped). The kind is told from the
 * first bytes, not from the name.
 */
#ifndef SAGA_PICTURE_H
#define SAGA_PICTURE_H

#include "capture.h"

/* Tells whether a file begins as an OpenEXR does. */
bool saga_picture_is_exr(const char *path);

bool saga_picture_probe(const char *path, int *width, int *height,
                        saga_error *error);
/* rgb is (height, width, 3); the file must have exactly that size. */
bool saga_picture_read(const char *path, int width, int height, uint8_t *rgb,
                       saga_error *error);

/* Gives the opacity instead, 255 everywhere in a picture without; only of PNGs:
 * R, G and B are all it. */
bool saga_picture_read_alpha(const char *path, int width, int height,
                             uint8_t *rgb, saga_error *error);

bool saga_png_probe(const char *path, int *width, int *height,
                    saga_error *error);
bool saga_png_read(const char *path, int width, int height, uint8_t *rgb,
                   saga_error *error);
bool saga_png_read_alpha(const char *path, int width, int height, uint8_t *rgb,
                         saga_error *error);
bool saga_png_write(const char *path, int width, int height,
                    const uint8_t *rgb, saga_error *error);

/* Writes 16 bits of grey; grey is (height, width). */
bool saga_png_write_grey(const char *path, int width, int height,
                         const uint16_t *grey, saga_error *error);

bool saga_jpeg_probe(const char *path, int *width, int *height,
                     saga_error *error);
bool saga_jpeg_read(const char *path, int width, int height, uint8_t *rgb,
                    saga_error *error);

/* Gives the bytes of a JPEG of good quality; free them. */
bool saga_jpeg_encode(uint8_t **bytes, size_t *nbytes, int width, int height,
                      const uint8_t *rgb, saga_error *error);

bool saga_exr_probe(const char *path, int *width, int *height,
                    saga_error *error);
bool saga_exr_read(const char *path, int width, int height, uint8_t *rgb,
                   saga_error *error);
/* Reads the channel Z, or the only one; (height, width) floats. */
bool saga_exr_read_depth(const char *path, int width, int height, float *depth,
                         saga_error *error);
/* Writes 8-bit sRGB as linear half floats: reading gives the same 8 bits again.
 */
bool saga_exr_write(const char *path, int width, int height,
                    const uint8_t *rgb, saga_error *error);
/* These write floats, (height, width), as the channel Z, or A. */
bool saga_exr_write_depth(const char *path, int width, int height,
                          const float *depth, saga_error *error);
bool saga_exr_write_alpha(const char *path, int width, int height,
                          const float *alpha, saga_error *error);

/* The sRGB transfer function (IEC 61966-2-1), back and forth. */
double saga_srgb_to_linear(double encoded);
uint8_t saga_linear_to_srgb8(double linear);

/* Checks the size of a picture against what its camera's first one has. */
bool saga_check_same_size(const char *path, int width, int height,
                          int expected_width, int expected_height,
                          saga_error *error);

/* Checks both sides against 1..SAGA_MAX_SIDE. */
bool saga_check_size(const char *path, long long width, long long height,
                     saga_error *error);

#endif
