/* SPDX-License-Identifier: MIT
 *
 * Reads films in the format .4dgs, draft of version 1, from its public
 * specification (website/docs/spec of avala-ai/4dgs). A splat moves in a
 * straight line, fades in and out like a Gaussian in time, and exists only
 * within a window of time:
 *
 *     0x89 "4DGS1" CR LF
 *     records: u8 kind  u64 n  n bytes
 *         header: duration, number of splats, degree of the harmonics
 *         quantisation: steps of all numbers
 *         windows: beginnings and ends
 *         chunks: the splats of an interval, a stream for each attribute;
 *             after each the harmonics of degree 1, 2 and 3, if it has any
 *         footer, the last
 *     0x89 "4DGS1" CR LF
 *
 * A stream has symbols of 1, 2 or 4 bytes, first the low bytes of all, packed
 * by zlib or zstd. A symbol is a signed number stored without its sign, as 2 n
 * or -2 n - 1, or the difference from the splat before; a constant is stored
 * once.
 *
 * Records without splats are skipped: the index, sounds, cameras, sensors,
 * names of objects. A film is refused if its splats depend on what is not read:
 * tracks of objects, the model "keyframe-delta", chunks packed as a whole,
 * linear colours. Its axes are taken to be those of PLY.
 */
#ifndef SAGA_CLOUD_4DGS_H
#define SAGA_CLOUD_4DGS_H

#include "cloud.h"
#include "file.h"

typedef struct saga_4dgs saga_4dgs;

/* Tells whether the bytes, of which the first SAGA_4DGS_MAGIC_NBYTES suffice,
 * begin as such a file does, of whatever version. */
enum { SAGA_4DGS_MAGIC_NBYTES = 8 };
bool saga_is_4dgs(const saga_bytes *bytes);

/* Opens a film that was read from `path`, which serves messages. The bytes and
 * the path must outlive it. The format has no frames: frame k of a film with
 * fps frames per second is the moment (k + 1/2) / fps. Returns NULL if the file
 * is refused; otherwise the caller frees it. */
saga_4dgs *saga_4dgs_open(const saga_bytes *bytes, const char *path, double fps,
                          saga_error *error);

void saga_4dgs_free(saga_4dgs *film); /* NULL is allowed */

int saga_4dgs_n_frames(const saga_4dgs *film);

/* Makes the cloud of a frame and cleans it up with saga_cloud_tidy. */
bool saga_4dgs_read(saga_cloud *cloud, const saga_4dgs *film, int frame,
                    saga_error *error);

#endif
