/* SPDX-License-Identifier: MIT
 *
 * SPZ, by its public description: a header, then one array of each attribute
 * of all splats, little-endian. With the axes right, up, back:
 *
 *     position   3 integers of 24 bits, a number of them behind the point
 *     opacity    a byte, 0..1
 *     colour     3 bytes: 255 (0.15 c + 1/2) of the constant harmonic
 *     scale      3 bytes: sixteenths of the logarithm, from -10 on
 *     rotation   version 2: x, y, z in a byte each; from 3 on: the three
 *                smallest components in 10 bits each, and which is left out
 *     harmonics  3 bytes for each above the constant one, 128 is 0 and 256 a 2
 *
 * Versions 2 and 3 are one gzip stream. Version 4 has a longer header in the
 * open and a zstd stream for each array. Version 3 is written, since more
 * programs read it than read version 4.
 */
#ifndef SAGA_CLOUD_SPZ_H
#define SAGA_CLOUD_SPZ_H

#include "cloud_files.h"

enum {
    SPZ_MAGIC = 0x5053474e,  /* "NGSP" */
    SPZ_HEADER_NBYTES = 16, SPZ_OPEN_HEADER_NBYTES = 32,
    SPZ_QUAT_STEPS = 511     /* bits of a component, and a sign bit */
};

/* A colour's byte covers more than 0..1 of the constant harmonic's. */
#define SPZ_COLOUR_PART 0.15

/* Reads the splats of a file's bytes as they are there, with the file's axes;
 * path is for messages. *axis is the one around which half a turn brings PLY's
 * axes (saga_cloud_turn), -1 if the file has them. */
bool saga_spz_decode(saga_cloud *cloud, int *axis, const saga_bytes *bytes,
                     const char *path, saga_error *error);

/* Is it a gzip stream, or does it begin as version 4 does? */
bool saga_is_spz(const saga_bytes *bytes);

/* Reads all splats of a file, with PLY's axes. */
bool saga_spz_read(saga_cloud *cloud, const saga_bytes *bytes,
                   const char *path, saga_error *error);

#endif
