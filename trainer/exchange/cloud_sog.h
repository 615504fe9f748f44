/* SPDX-License-Identifier: MIT
 *
 * The format SOG, version 2, from its public description. It has a text,
 * meta.json, and pictures with one pixel for each splat, row by row. They are
 * the members of a ZIP archive, or the files of a folder.
 *
 *     means_l, means_u  the low and the high byte of a coordinate's 16 bits,
 *                       which cover a range of sign(x) log(1 + |x|)
 *     scales            indices into a list of 256 logarithms of scales
 *     quats             the components of w, x, y, z but the largest one, in 8
 *                       bits each for -sqrt(1/2)..sqrt(1/2); alpha, 252 to 255,
 *                       says which is the largest
 *     sh0               indices into a list of 256 coefficients of the constant
 *                       harmonic; alpha is the opacity
 *     shN_labels        16 bits: the index of a row of the palette
 *     shN_centroids     the palette of the other harmonics: 64 rows side by
 *                       side, a pixel for each harmonic, with indices into a
 *                       list of 256 coefficients
 *
 * Positions have the axes of PLY files.
 */
#ifndef SAGA_CLOUD_SOG_H
#define SAGA_CLOUD_SOG_H

#include "cloud_files.h"

enum {
    SOG_VERSION = 2,
    SOG_CODES = 256,
    SOG_ROWS_ABREAST = 64,
    SOG_MOST_ROWS = 65536,
    SOG_FIRST_MODE = 252
};

/* Tells whether the bytes are a ZIP archive, or a text that begins as JSON
 * does. */
bool saga_is_sog(const saga_bytes *bytes);

bool saga_sog_read(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                   saga_error *error);

#endif
