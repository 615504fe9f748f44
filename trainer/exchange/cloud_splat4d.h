/* SPDX-License-Identifier: MIT
 *
 * Reads films in the format .splat4d, version 1, from its public description
 * (FORMAT.md of adamraudonis/splats4D). A film has the same splats in all
 * frames. Five attributes of a splat, its position, rotation, colour, opacity
 * and scale, either stand still or move:
 *
 *     "SP4D"  u16 version  u16 flags  u32 n  n bytes of JSON
 *     section of what stands still: for each attribute, a bit for each splat
 *         that tells whether it does; then a value for each splat
 *     groups of frames: the values of those that move at the group's first
 *         frame, and the differences from frame to frame
 *
 * Values are whole multiples of steps in the JSON, which also has the places of
 * the section and of the groups. Positions and logarithms of scales have their
 * own, finer steps in the section. A signed number is stored without its sign,
 * as 2 n or -2 n - 1. A stream of numbers has 1, 2 or 4 bytes a number, first
 * the low bytes of all, and is packed by zstd.
 */
#ifndef SAGA_CLOUD_SPLAT4D_H
#define SAGA_CLOUD_SPLAT4D_H

#include "cloud.h"
#include "file.h"

typedef struct saga_splat4d saga_splat4d;

/* Tells whether the bytes, of which the first SAGA_SPLAT4D_HEAD_NBYTES suffice,
 * begin as such a file does. */
enum { SAGA_SPLAT4D_HEAD_NBYTES = 12 };
bool saga_is_splat4d(const saga_bytes *bytes);

/* Opens a film that was read from `path`, which serves messages. The bytes and
 * the path must outlive it. Returns NULL if the file is refused; otherwise the
 * caller frees it. */
saga_splat4d *saga_splat4d_open(const saga_bytes *bytes, const char *path,
                                saga_error *error);

void saga_splat4d_free(saga_splat4d *film); /* NULL is allowed */

int saga_splat4d_n_frames(const saga_splat4d *film);
double saga_splat4d_fps(const saga_splat4d *film);

/* Makes the cloud of a frame and cleans it up with saga_cloud_tidy. Frames that
 * are read in order take the least time. */
bool saga_splat4d_read(saga_cloud *cloud, saga_splat4d *film, int frame,
                       saga_error *error);

#endif
