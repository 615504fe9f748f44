/* SPDX-License-Identifier: MIT
 *
 * Writes a ZIP archive of uncompressed members. It stores no times, so equal
 * members give equal files.
 */
#ifndef SAGA_ZIP_WRITE_H
#define SAGA_ZIP_WRITE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* Before the first member the caller sets `file` and `path`, and the rest to
 * 0. */
typedef struct saga_zip_out {
    FILE *file;
    const char *path; /* for messages */
    uint8_t *directory;
    size_t directory_nbytes, n_members;
    uint64_t nbytes; /* bytes written */
} saga_zip_out;

/* Adds a member. Fails if the archive would be larger than 2 GB. */
bool saga_zip_add(saga_zip_out *zip, const char *name, const uint8_t *bytes,
                  size_t n, saga_error *error);

/* If ok, writes the directory at the end of the archive; frees it in any case.
 * Returns false if ok is false or a write fails. Errors of buffered writes show
 * only when the caller closes the file. */
bool saga_zip_end(saga_zip_out *zip, bool ok);

#endif
