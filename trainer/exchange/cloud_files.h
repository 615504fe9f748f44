/* SPDX-License-Identifier: MIT
 *
 * Reads and writes clouds in the file formats that viewers of splats use. One
 * table lists all formats; detection, messages and help texts go through it.
 * Each format has its own source file.
 *
 * A cloud in memory has the axes of PLY. A format with other axes turns the
 * cloud after reading, and before and after writing.
 */
#ifndef SAGA_CLOUD_FILES_H
#define SAGA_CLOUD_FILES_H

#include "cloud.h"
#include "file.h"

/* The numbers that a format can hold; 0: any. */
typedef struct saga_cloud_limits {
    float log_scale[2];   /* least and most */
    float constant, rest; /* largest magnitude of a coefficient of the
                           * constant harmonic, and of the others */
} saga_cloud_limits;

/* One file format. `read` does not judge the numbers or the splats of a file,
 * which saga_cloud_tidy does later; it parses `bytes`, and uses the path for
 * messages and to find files beside it. It begins with saga_cloud_admit, before
 * it takes other memory for the splats. If it fails, the cloud is empty.
 * `write` leaves either a complete file or none. */
typedef struct saga_cloud_format {
    const char *name;    /* the format's name in messages */
    const char *suffix;  /* suffix of its file names */
    const char *carries; /* its precision, for help texts */
    bool (*is_it)(const saga_bytes *bytes);
    bool (*read)(saga_cloud *cloud, const saga_bytes *bytes, const char *path,
                 saga_error *error);
    bool (*write)(const char *path, saga_cloud *cloud, saga_error *error);
    saga_cloud_limits limits; /* numbers beyond them are clamped by `write` */
} saga_cloud_format;

/* Returns how many splats have scales (of = 0) or colours (of = 1) beyond the
 * limits of a format. */
size_t saga_cloud_beyond(const saga_cloud *cloud,
                         const saga_cloud_format *format, int of);

/* Returns format i of the table, or NULL after the last one. */
const saga_cloud_format *saga_cloud_format_at(int i);

/* Returns the format whose suffix the name has, or NULL. */
const saga_cloud_format *saga_cloud_format_of(const char *name);

/* Tells whether a file of the format holds the splats of all frames. */
bool saga_cloud_moves(const saga_cloud_format *format);

/* Writes the suffixes of all formats, separated by commas, for messages. */
enum { SAGA_SUFFIXES_NBYTES = 128 };
void saga_cloud_suffixes(char text[SAGA_SUFFIXES_NBYTES]);

/* Writes a cloud in the format of the name's suffix. The cloud is the same
 * afterwards. Fails if the suffix is unknown, or if the format cannot represent
 * the numbers. */
bool saga_cloud_write(const char *path, saga_cloud *cloud, saga_error *error);

/* Reads a file, whose format is recognised by its bytes and not by its name,
 * and cleans up the splats with saga_cloud_tidy. The file and its splats may
 * take most_nbytes of memory; 0: any. */
bool saga_cloud_read(saga_cloud *cloud, const char *path, uint64_t most_nbytes,
                     saga_error *error);

/* The same for `frame` of a file whose splats move (cloud->n_frames); that of
 * saga_cloud_read is 0. Splats that are not seen in it are left out. */
bool saga_cloud_read_frame(saga_cloud *cloud, const char *path, uint32_t frame,
                           uint64_t most_nbytes, saga_error *error);

/* Removes splats with numbers that are not finite or are very large, rows of
 * zeros, and splats too faint to be drawn; converts scales and opacities to
 * logarithms and logits; limits logits to 16 and normalises quaternions. What
 * it does is counted in cloud->facts. Fails if no splat is left; `path` serves
 * the message. */
bool saga_cloud_tidy(saga_cloud *cloud, const char *path, saga_error *error);

/* Finds out which numbers a file's scales and opacities are, and makes them
 * logarithms and logits; what has none becomes NaN. The numbers must be
 * finite, except for logits. */
void saga_cloud_settle(saga_cloud *cloud);

/* Keeps the n splats with the largest products of opacity and area. */
bool saga_cloud_thin(saga_cloud *cloud, size_t n, saga_error *error);

#endif
