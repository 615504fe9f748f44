/* SPDX-License-Identifier: MIT
 *
 * Reads and writes pictures. The first bytes tell the format, whatever the name
 * says: PNG, JPEG, WebP and TIFF with samples of at most 16 bits in grey, RGB,
 * a palette or YCbCr, and OpenEXR, whose R G B (or Y) are linear light and
 * become 8-bit sRGB, and whose Z is depth. A file that holds anything else
 * (CMYK, Lab, raw or deep pixels, an animation, several pages) is refused by
 * the name of what it holds.
 *
 * Alpha has one rule for all formats, and for videos: pixels lie over black, so
 * that the colour under alpha 0 has no effect. If opacity is to be a mask
 * (--alpha-masks), pixels of alpha 128 to 255 count, with the colour that they
 * have without the black.
 *
 * Where the file says how its numbers are to be shown, but they are taken as
 * sRGB with square pixels, saga_picture_probe reports it.
 */
#ifndef SAGA_PICTURE_H
#define SAGA_PICTURE_H

#include "capture.h"

typedef struct saga_picture_look {
    int width, height; /* as stored */
    int orientation;   /* picture_turn.h */
    char ignored[80];  /* what the file asks for and reading does not do;
                        * "" if nothing */
} saga_picture_look;

bool saga_picture_probe(const char *path, saga_picture_look *look,
                        saga_error *error);

typedef enum saga_picture_form {
    SAGA_PICTURE_RGB,  /* over black */
    SAGA_PICTURE_RGBA, /* the colour without black; 0 under alpha 0 */
    SAGA_PICTURE_MASK  /* RGB in which 16 bits are rounded up to 8, so
                        * that only 0 becomes 0 */
} saga_picture_form;

typedef struct saga_picture_wish {
    int width, height; /* the picture must have exactly this size */
    bool upright;      /* turn it, if it asks to be shown with width and
                        * height exchanged */
    saga_picture_form form;
} saga_picture_wish;

/* Reads a picture into (height, width, 3 or 4) bytes. */
bool saga_picture_read(const char *path, const saga_picture_wish *wish,
                       uint8_t *pixels, saga_error *error);

/* Returns how many bytes a pixel reading a picture takes besides the result and
 * the depth; 0 if the file cannot be read. */
int saga_picture_scratch(const char *path);

bool saga_png_write(const char *path, int width, int height, const uint8_t *rgb,
                    saga_error *error);

/* Writes a PNG of straight colours and opacity, (height, width, 4). */
bool saga_png_write_rgba(const char *path, int width, int height,
                         const uint8_t *rgba, saga_error *error);

/* Writes a PNG of grey, (height, width), with 16 bits. */
bool saga_png_write_grey(const char *path, int width, int height,
                         const uint16_t *grey, saga_error *error);

/* Encodes a JPEG of good quality. The caller frees *bytes with free(). */
bool saga_jpeg_encode(uint8_t **bytes, size_t *nbytes, int width, int height,
                      const uint8_t *rgb, saga_error *error);

/* Reads the channel Z, or the only channel, as (height, width) floats; 0
 * outside the data window. */
bool saga_exr_read_depth(const char *path, int width, int height, float *depth,
                         saga_error *error);
/* Writes 8-bit sRGB as linear half floats; reading them returns the same 8
 * bits. */
bool saga_exr_write(const char *path, int width, int height, const uint8_t *rgb,
                    saga_error *error);
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
