/* SPDX-License-Identifier: MIT
 *
 * A montage is several pictures in one PNG, to be looked at side by side.
 */
#ifndef SAGA_MONTAGE_H
#define SAGA_MONTAGE_H

#include "capture.h"

enum { SAGA_MONTAGE_GAP = 4 }; /* pixels between pictures */

typedef struct saga_still {
    const uint8_t *rgb;      /* (height, width, 3) */
    int width, height;
} saga_still;

/* Writes n >= 1 pictures, row by row with `columns` in each, on mid grey.
 * Columns are as wide as the widest picture, rows as high as the highest. */
bool saga_montage_write(const char *path, const saga_still *stills, int n,
                        int columns, saga_error *error);

/* Shows truth, decode and difference x gain side by side, of equal sizes. */
bool saga_montage_compare(const char *path, const saga_still *truth,
                          const saga_still *decode, int gain,
                          saga_error *error);

/* out = |a - b| * gain, clipped, for n samples. */
void saga_difference(uint8_t *out, const uint8_t *a, const uint8_t *b,
                     size_t n, int gain);

#endif
