/* SPDX-License-Identifier: MIT
 *
 * Writes a ZIP archive of stored members, without their times: the same members
 * make the same file.
 */
#ifndef SAGA_ZIP_WRITE_H
#define SAGA_ZIP_WRITE_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>

/* The caller sets only file and path before the first member. */
typedef struct saga_zip_out {
    FILE *file;
    const char *path;        /* for messages */
    uint8_t *directory;
    size_t directory_nbytes, n_members;
    uint64_t nbytes;         /* bytes written */
} saga_zip_out;

/* Adds a member; the archive stays below 2^32 bytes. */
bool saga_zip_add(saga_zip_out *zip, const char *name, const uint8_t *bytes,
                  size_t n, saga_error *error);

/* Writes the directory if ok, and releases it. Returns false if anything has
 * failed; a failed write is told when the file is closed. */
bool saga_zip_end(saga_zip_out *zip, bool ok);

#endif
