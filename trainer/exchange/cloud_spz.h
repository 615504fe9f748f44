/* SPDX-License-Identifier: MIT
 *
 * The format SPZ, from its public description: a header is followed by one
 * little-endian array for each attribute, over all splats. The axes x, y, z
 * point right, up and backward. A splat has:
 *
 *     position   3 fixed-point numbers of 24 bits; the header says how many of
 *                the bits follow the point
 *     opacity    a byte, 0..1
 *     colour     3 bytes: 255 (0.15 c + 1/2), with the constant harmonic's
 *                coefficient c
 *     scale      3 bytes: the logarithm plus 10, in sixteenths
 *     rotation   in version 2: x, y, z in a byte each; since version 3: the
 *                three smallest components in 10 bits each, and the index of
 *                the largest, which is left out
 *     harmonics  3 bytes for each but the constant one, c = (byte - 128) / 128
 *
 * Files of versions 2 and 3 are one gzip stream. In version 4 an uncompressed,
 * longer header is followed by a table of lengths and a zstd stream for each
 * array. More programs read version 3 than version 4; the name of a file says
 * which of both is written.
 */
#ifndef SAGA_CLOUD_SPZ_H
#define SAGA_CLOUD_SPZ_H

#include "cloud_files.h"

enum {
    SPZ_MAGIC = 0x5053474e, /* "NGSP" */
    SPZ_HEADER_NBYTES = 16,
    SPZ_OPEN_HEADER_NBYTES = 32,
    SPZ_QUAT_STEPS = 511 /* 9 bits of magnitude, besides a sign bit */
};

/* The factor of a colour's coefficient in its byte. It is smaller than Y_0, so
 * that a byte covers more than the colours 0..1. */
#define SPZ_COLOUR_PART 0.15

/* Tells whether the bytes are a gzip stream, or begin as version 4 does. */
bool saga_is_spz(const saga_bytes *bytes);

/* Reads all splats of a file and turns them to the axes of PLY. */
bool saga_spz_read(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                   saga_error *error);

#endif
