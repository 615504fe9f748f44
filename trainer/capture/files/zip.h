/* SPDX-License-Identifier: MIT
 *
 * Reads the members of a ZIP archive, stored or deflated, by their names.
 */
#ifndef SAGA_ZIP_H
#define SAGA_ZIP_H

#include "file.h"

typedef struct saga_zip {
    const char *path; /* for messages; owned by the caller */
    saga_bytes bytes; /* the whole file, owned by the caller */
    size_t directory; /* offset of the list of members */
    uint32_t n_members;
} saga_zip;

/* Finds the directory of an archive; returns false if there is none. */
bool saga_zip_open(saga_zip *zip, const saga_bytes *bytes, const char *path);

bool saga_zip_has(const saga_zip *zip, const char *name);

/* Unpacks a member of at most `most` bytes and checks its CRC. It is released
 * with saga_bytes_free. */
bool saga_zip_read(saga_bytes *member, const saga_zip *zip, const char *name,
                   uint64_t most, saga_error *error);

#endif
