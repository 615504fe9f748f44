/* SPDX-License-Identifier: MIT
 *
 * Reads and writes pictures. The format is recognised by the first bytes, not
 * by the name: PNG (8 or 16 bits, grey, palette or colour; alpha is composited
 * over black; gamma chunks are ignored, as in video pipelines), JPEG (grey or
 * colour; not rotated by EXIF, because calibration ignores it, too), OpenEXR
 * (scanlines; R G B are linear light and become 8-bit sRGB; Z is depth), and,
 * through ffmpeg, WebP and TIFF (alpha is dropped).
 */
#ifndef SAGA_PICTURE_H
#define SAGA_PICTURE_H

#include "capture.h"

/* Returns whether a file begins with OpenEXR's magic number. */
bool saga_picture_is_exr(const char *path);

bool saga_picture_probe(const char *path, int *width, int *height,
                        saga_error *error);
/* Reads a picture into rgb, (height, width, 3); the file must have exactly that
 * size. */
bool saga_picture_read(const char *path, int width, int height, uint8_t *rgb,
                       saga_error *error);

/* Reads the opacity of a picture into R, G and B alike; 255 if the picture has
 * none. PNG only. */
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

/* Writes a PNG of grey, (height, width), with 16 bits. */
bool saga_png_write_grey(const char *path, int width, int height,
                         const uint16_t *grey, saga_error *error);

bool saga_jpeg_probe(const char *path, int *width, int *height,
                     saga_error *error);
bool saga_jpeg_read(const char *path, int width, int height, uint8_t *rgb,
                    saga_error *error);

/* Encodes a JPEG of good quality. The caller frees *bytes with free(). */
bool saga_jpeg_encode(uint8_t **bytes, size_t *nbytes, int width, int height,
                      const uint8_t *rgb, saga_error *error);

bool saga_exr_probe(const char *path, int *width, int *height,
                    saga_error *error);
bool saga_exr_read(const char *path, int width, int height, uint8_t *rgb,
                   saga_error *error);
/* Reads the channel Z, or the only channel, as (height, width) floats. */
bool saga_exr_read_depth(const char *path, int width, int height, float *depth,
                         saga_error *error);
/* Writes 8-bit sRGB as linear half floats; reading them returns the same 8
 * bits. */
bool saga_exr_write(const char *path, int width, int height,
                    const uint8_t *rgb, saga_error *error);
/* Write floats, (height, width), as the channel Z or A. */
bool saga_exr_write_depth(const char *path, int width, int height,
                          const float *depth, saga_error *error);
bool saga_exr_write_alpha(const char *path, int width, int height,
                          const float *alpha, saga_error *error);

/* The sRGB transfer function (IEC 61966-2-1) and its inverse. */
double saga_srgb_to_linear(double encoded);
uint8_t saga_linear_to_srgb8(double linear);

/* Checks that a picture has the expected size, that of its camera's first
 * picture. */
bool saga_check_same_size(const char *path, int width, int height,
                          int expected_width, int expected_height,
                          saga_error *error);

/* Checks that both sides are in 1..SAGA_MAX_SIDE. */
bool saga_check_size(const char *path, long long width, long long height,
                     saga_error *error);

#endif
