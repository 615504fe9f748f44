/* SPDX-License-Identifier: MIT
 *
 * A cloud is written in the formats that viewers of splats read, and read from
 * them. All formats stand in one table, over which detection, messages and
 * helps loop; each has a file of its own.
 *
 * A cloud has PLY's axes. A format that has others turns the cloud when it
 * reads, and there and back when it writes.
 */
#ifndef SAGA_CLOUD_FILES_H
#define SAGA_CLOUD_FILES_H

#include "cloud.h"
#include "file.h"

/* A format. Its reader takes any numbers, and any splats that a file has; the
 * file's bytes are given, and its path serves messages and files beside it. A
 * reader that fails leaves an empty cloud. A written file appears whole or not
 * at all. */
typedef struct saga_cloud_format {
    const char *name;        /* as messages have it */
    const char *suffix;      /* of files' names */
    const char *carries;     /* how it keeps the numbers; for helps */
    bool (*is_it)(const saga_bytes *bytes);
    bool (*read)(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                 saga_error *error);
    bool (*write)(const char *path, saga_cloud *cloud, saga_error *error);
} saga_cloud_format;

/* Returns format i of the table, NULL behind the last. */
const saga_cloud_format *saga_cloud_format_at(int i);

/* Returns the format with whose suffix the name ends, NULL if there is none. */
const saga_cloud_format *saga_cloud_format_of(const char *name);

/* Writes all suffixes, separated by commas, for messages. */
enum { SAGA_SUFFIXES_NBYTES = 128 };
void saga_cloud_suffixes(char text[SAGA_SUFFIXES_NBYTES]);

/* Writes a cloud as the name's suffix says. The cloud is as it was behind it.
 * Fails if the name has no known suffix, or the format has no room for the
 * numbers. */
bool saga_cloud_write(const char *path, saga_cloud *cloud, saga_error *error);

/* Reads a file, whose bytes and not whose name tell the format, and tidies the
 * splats (saga_cloud_tidy). */
bool saga_cloud_read(saga_cloud *cloud, const char *path, saga_error *error);

/* Leaves out splats with numbers that are not finite or that are too faint to
 * be drawn, limits logits to 16, and makes quaternions unit ones. Fails if no
 * splat is left; path is for the message. */
bool saga_cloud_tidy(saga_cloud *cloud, const char *path, saga_error *error);

#endif
