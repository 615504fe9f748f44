/* SPDX-License-Identifier: MIT
 *
 * What the readers of the formats are to picture.c: an entry of its table each.
 */
#ifndef SAGA_PICTURE_KINDS_H
#define SAGA_PICTURE_KINDS_H

#include "picture.h"

typedef struct saga_picture_kind {
    int scratch; /* as of saga_picture_scratch */
    bool (*probe)(const char *path, saga_picture_look *look, saga_error *error);
    /* Reads a picture as it is stored. RGBA may have colour under alpha 0. */
    bool (*read)(const char *path, const saga_picture_wish *wish,
                 uint8_t *pixels, saga_error *error);
} saga_picture_kind;

extern const saga_picture_kind saga_png_kind, saga_jpeg_kind, saga_exr_kind,
    saga_webp_kind, saga_tiff_kind;

/* Returns the orientation in a block of EXIF, which is a small TIFF, with or
 * without "Exif" before it; 0 if it has none. */
int saga_exif_orientation(const uint8_t *data, size_t n);

/* Sets look->ignored to the name of an ICC profile that is not sRGB, unless
 * something else is ignored. The profile may be cut. */
void saga_picture_tell_profile(const uint8_t *data, size_t n,
                               saga_picture_look *look);

/* Returns the bytes of a pixel of a form. */
static inline size_t saga_picture_pixel(saga_picture_form form)
{
    return form == SAGA_PICTURE_RGBA ? 4 : 3;
}

/* Lays RGBA, (n, 4), over black as (n, 3). */
void saga_picture_over_black(const uint8_t *rgba, size_t n, uint8_t *rgb);
/* Makes the colour under alpha 0 black in RGBA, (n, 4). */
void saga_picture_clear_hidden(uint8_t *rgba, size_t n);

#endif
