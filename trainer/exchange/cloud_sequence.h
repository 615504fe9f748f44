/* SPDX-License-Identifier: MIT
 *
 * A sequence of clouds in one file, in one of the formats .splat4d and .4dgs,
 * which are only read. The bytes tell the format.
 */
#ifndef SAGA_CLOUD_SEQUENCE_H
#define SAGA_CLOUD_SEQUENCE_H

#include "cloud.h"
#include "file.h"

typedef struct saga_cloud_sequence saga_cloud_sequence;

/* Tells whether the bytes, of which the first SAGA_SEQUENCE_HEAD_NBYTES
 * suffice, begin as such a file does. */
enum { SAGA_SEQUENCE_HEAD_NBYTES = 12 };
bool saga_is_sequence(const saga_bytes *bytes);

/* Opens a sequence that was read from `path`, which serves messages. The bytes
 * and the path must outlive it. `fps` is the frame rate, or NaN: then it is the
 * file's, or 30 if the file has none. Returns NULL if the file is refused;
 * otherwise the caller frees it. */
saga_cloud_sequence *saga_sequence_open(const saga_bytes *bytes,
                                        const char *path, double fps,
                                        saga_error *error);

void saga_sequence_free(saga_cloud_sequence *sequence); /* NULL is allowed */

int saga_sequence_n_frames(const saga_cloud_sequence *sequence);
double saga_sequence_fps(const saga_cloud_sequence *sequence);

/* Makes the cloud of a frame and cleans it up with saga_cloud_tidy. Frames that
 * are read in order take the least time. */
bool saga_sequence_read(saga_cloud *cloud, saga_cloud_sequence *sequence,
                        int frame, saga_error *error);

#endif
