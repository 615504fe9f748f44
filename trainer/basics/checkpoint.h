/* SPDX-License-Identifier: MIT
 *
 * A checkpoint is a file that holds the state of a program. The same function
 * walks over the state to write and to read it, because saga_checkpoint_walk
 * knows the direction. The file appears as a whole or not at all. It ends with
 * a digest of all its bytes, which is checked before any of them is used.
 * Numbers are in the byte order of the machine, so a checkpoint is not
 * portable.
 */
#ifndef SAGA_CHECKPOINT_H
#define SAGA_CHECKPOINT_H

#include "file.h"
#include "output.h"

typedef struct saga_checkpoint {
    const char *path;
    bool reading;
    bool failed;  /* after a failure nothing is written, and
                   * everything that is read is zero */
    uint64_t sum; /* digest of what was written */
    saga_output out;
    saga_bytes bytes;
    saga_cursor rest;
} saga_checkpoint;

/* Begin to write or read a checkpoint. path must outlive *c. Reading fails if
 * the file is no checkpoint of this version of the program, or is damaged or
 * truncated. After success, the caller calls saga_checkpoint_close. */
bool saga_checkpoint_create(saga_checkpoint *c, const char *path,
                            saga_error *error);
bool saga_checkpoint_open(saga_checkpoint *c, const char *path,
                          saga_error *error);

/* Tells whether bytes begin like a checkpoint, of any version. */
bool saga_checkpoint_is(const uint8_t *bytes, size_t nbytes);

/* Writes nbytes at data to the file, or reads them from it. */
void saga_checkpoint_walk(saga_checkpoint *c, void *data, size_t nbytes);

/* Writes a number; when reading, fails if it is different. */
void saga_checkpoint_expect(saga_checkpoint *c, uint64_t value);

/* Ends a checkpoint. ok says whether the caller succeeded. Returns false with
 * *error set if ok is false or anything failed; then no file was written, or
 * the data that was read is inconsistent. */
bool saga_checkpoint_close(saga_checkpoint *c, bool ok, saga_error *error);

/* Computes the 64-bit FNV-1a digest, which detects damage and changes. The
 * first call gets SAGA_DIGEST_START as sum, and each further call the previous
 * result, so that the digest does not depend on how the data is divided. */
#define SAGA_DIGEST_START 0xcbf29ce484222325u
uint64_t saga_digest(uint64_t sum, const void *data, size_t nbytes);

#endif
