/* SPDX-License-Identifier: MIT
 *
 * Reads the arrays of a .npz file, which is a ZIP archive of .npy files, as
 * numpy.savez (stored) and numpy.savez_compressed (deflated) write it.
 */
#ifndef SAGA_NPZ_H
#define SAGA_NPZ_H

#include "file.h"
#include "npy.h"
#include "zip.h"

typedef struct saga_npz {
    const char *path; /* for messages; owned by the caller */
    saga_bytes bytes; /* the whole file */
    saga_zip zip;
} saga_npz;

/* Reads the file and finds its directory. Call saga_npz_close even after a
 * failure. */
bool saga_npz_open(saga_npz *npz, const char *path, saga_error *error);

/* Returns whether there is an array of this name (without ".npy"). */
bool saga_npz_has(const saga_npz *npz, const char *name);

/* Reads an array and checks its CRC. */
bool saga_npz_read(saga_npy *npy, const saga_npz *npz, const char *name,
                   saga_error *error);

void saga_npz_close(saga_npz *npz);

#endif
