/* SPDX-License-Identifier: MIT
 *
 * Compressed PLY, as PlayCanvas has it: splats in chunks of 256, whose numbers
 * are integers within the ranges of their chunk. A binary PLY with the elements
 *
 *     chunk   18 floats: the ranges of positions, logarithms of scales, colours
 *             (1/2 + Y_0 c; files without these have 0..1)
 *     vertex  4 words: position and scale in 11, 10 and 11 bits; rotation in 2
 *             bits for the largest component of w, x, y, z, which is left out,
 *             and 10 for each other; colour and opacity in 8 bits each
 *     sh      a byte for each value of f_rest, -4..4; may be missing
 */
#ifndef SAGA_CLOUD_PACKED_H
#define SAGA_CLOUD_PACKED_H

#include "cloud_files.h"

enum {
    PACKED_CHUNK = 256, PACKED_COLUMNS = 18, PACKED_WORDS = 4,
    PACKED_MOST_REST = 3 * (SAGA_MAX_HARMONICS - 1)
};

/* The ranges of a chunk, as they stand in the file. */
typedef struct packed_ranges {
    float mean[2][3], log_scale[2][3], rgb[2][3]; /* least, most */
} packed_ranges;

extern const char *const saga_packed_columns[PACKED_COLUMNS];
extern const char *const saga_packed_words[PACKED_WORDS];

bool saga_is_packed(const saga_bytes *bytes);

bool saga_packed_read(saga_cloud *cloud, const saga_bytes *bytes,
                      const char *path, saga_error *error);

#endif
