/* SPDX-License-Identifier: MIT
 *
 * SOG version 2, by its public description: a text meta.json and pictures, a
 * pixel for each splat, row by row; as a ZIP archive, or in a folder.
 *
 *     means_l, means_u  the low and the high byte of 16 bits of each position,
 *                       within a range; sign(x) log(1 + |x|) is what is kept
 *     scales            a number of a list of 256 logarithms of scales
 *     quats             the three components of w, x, y, z besides the largest,
 *                       8 bits of -sqrt(1/2)..sqrt(1/2) each; alpha 252 to 255
 *                       tells the largest
 *     sh0               numbers of a list of 256 coefficients; alpha is opacity
 *     shN_labels        16 bits: a row of the palette
 *     shN_centroids     the palette: 64 rows side by side, a pixel for each
 *                       harmonic with numbers of a list of 256 coefficients
 *
 * Positions have PLY's axes.
 */
#ifndef SAGA_CLOUD_SOG_H
#define SAGA_CLOUD_SOG_H

#include "cloud_files.h"

enum {
    SOG_VERSION = 2, SOG_CODES = 256, SOG_ROWS_ABREAST = 64,
    SOG_MOST_ROWS = 65536, SOG_FIRST_MODE = 252
};

/* Is it a ZIP archive, or a text that begins as JSON does? */
bool saga_is_sog(const saga_bytes *bytes);

bool saga_sog_read(saga_cloud *cloud, const saga_bytes *bytes,
                   const char *path, saga_error *error);

#endif
