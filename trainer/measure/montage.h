/* SPDX-License-Identifier: MIT
 *
 * A montage puts several pictures side by side in one PNG.
 */
#ifndef SAGA_MONTAGE_H
#define SAGA_MONTAGE_H

#include "capture.h"

enum { SAGA_MONTAGE_GAP = 4 }; /* pixels between pictures */

typedef struct saga_still {
    const uint8_t *rgb; /* (height, width, 3) */
    int width, height;
} saga_still;

/* Writes n >= 1 pictures, row by row with `columns` in each, on mid grey.
 * All columns are as wide as the widest picture, all rows as high as the
 * highest. */
bool saga_montage_write(const char *path, const saga_still *stills, int n,
                        int columns, saga_error *error);

/* Writes truth, decode and their difference times `gain` side by side; truth
 * and decode must have the same size. */
bool saga_montage_compare(const char *path, const saga_still *truth,
                          const saga_still *decode, int gain,
                          saga_error *error);

/* Sets out = |a - b| * gain, clipped to 255, for n samples. */
void saga_difference(uint8_t *out, const uint8_t *a, const uint8_t *b, size_t n,
                     int gain);

#endif
