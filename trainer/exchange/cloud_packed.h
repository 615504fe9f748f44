/* SPDX-License-Identifier: MIT
 *
 * PlayCanvas' compressed PLY. Splats are stored in chunks of 256, and their
 * numbers are integers that cover the ranges of their chunk. It is a binary PLY
 * file with these elements:
 *
 *     chunk   18 floats: the ranges of positions, of logarithms of scales and
 *             of colours (1/2 + Y_0 c); colours without a range have 0..1
 *     vertex  4 words: one each for position and scale, with 11, 10 and 11 bits
 *             for x, y, z; one for the rotation, with 2 bits for the index of
 *             the largest component of w, x, y, z, which is left out, and 10
 *             bits for each other; and one for colour and opacity, with 8 bits
 *             for each of R, G, B and opacity
 *     sh      a byte for each value of f_rest, covering -4..4; this element may
 *             be missing
 */
#ifndef SAGA_CLOUD_PACKED_H
#define SAGA_CLOUD_PACKED_H

#include "cloud_files.h"

enum {
    PACKED_CHUNK = 256,
    PACKED_COLUMNS = 18,
    PACKED_WORDS = 4,
    PACKED_MOST_REST = 3 * (SAGA_MAX_HARMONICS - 1)
};

/* The ranges of a chunk, in the order of the file. */
typedef struct packed_ranges {
    float mean[2][3], log_scale[2][3], rgb[2][3]; /* minima, maxima */
} packed_ranges;

extern const char *const saga_packed_columns[PACKED_COLUMNS];
extern const char *const saga_packed_words[PACKED_WORDS];

bool saga_is_packed(const saga_bytes *bytes);

bool saga_packed_read(saga_cloud *cloud, const saga_bytes *bytes,
                      const char *path, saga_error *error);

#endif
