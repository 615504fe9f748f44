/* SPDX-License-Identifier: MIT
 *
 * Pictures as most videos hold them (4:2:0): a plane of luma, then two of
 * chroma, Cb and Cr, with half the columns and rows; a sample has 8 bits, or 10
 * in two bytes, little-endian.
 *
 * RGB is computed with ffmpeg's arithmetic, so that the values are those that
 * ffmpeg gives for flags=bicubic+accurate_rnd+full_chroma_int+bitexact, to the
 * bit. A chroma sample lies in the middle of its four pixels. Chroma is
 * interpolated by the cubic kernel with B = 0 and C = 0.6, first along columns,
 * then along rows; samples beyond the border are those at the border. Its taps
 * are at 1/4 and 3/4 of the way between samples.
 */
#ifndef SAGA_FILMED_H
#define SAGA_FILMED_H

#include "isa.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef struct saga_filmed {
    int depth; /* bits of a sample, 8 or 10; 0: pictures are RGB */
    /* The colour matrix in 1/8192: of luma after the offset, and of Cr and Cb
     * in red, green and blue. */
    int32_t luma, offset, cr_red, cr_green, cb_green, cb_blue;
} saga_filmed;

/* Sets the conversion for a matrix by its name in ffmpeg's scaler. Returns
 * false, and depth 0, if there is none for this matrix or depth. */
bool saga_filmed_init(saga_filmed *filmed, int depth, const char *matrix,
                      bool full_range);

/* Tells whether pictures of this size can be converted: sides are even, and at
 * least 16, since ffmpeg has other kernels for smaller ones. */
static inline bool saga_filmed_fits(int width, int height)
{
    return width >= 16 && height >= 16 && width % 2 == 0 && height % 2 == 0;
}

/* Returns the bytes of a picture of 8 or 10 bits, at most those of its RGB. */
static inline size_t saga_filmed_nbytes(int depth, int width, int height)
{
    return (size_t)width * (size_t)height / 2 * (depth > 8 ? 6 : 3);
}

/* Returns the bytes of working memory for a picture of this width. */
static inline size_t saga_filmed_room(int width)
{
    return (2 * 8 + 2 + 2 + 4) * sizeof(int16_t) * ((size_t)width + 8);
}

/* Converts a picture to (height, width, 3) bytes. `room` is working memory,
 * aligned for int32_t. */
#define saga_filmed_develop SAGA_ISA_NAME(saga_filmed_develop)
extern void saga_filmed_develop(uint8_t *rgb, const uint8_t *picture,
                                const saga_filmed *filmed, const int size[2],
                                void *room);

#endif
