/* SPDX-License-Identifier: MIT
 *
 * A checkpoint is a file that holds the state of a program. One walk over the
 * state writes it and reads it back: saga_checkpoint_walk knows the direction.
 * A file appears whole or not at all, and ends with a digest of all its bytes,
 * which is compared before the first of them is believed. Numbers are in this
 * machine's byte order: a checkpoint does not travel.
 */
#ifndef SAGA_CHECKPOINT_H
#define SAGA_CHECKPOINT_H

#include "file.h"
#include "output.h"

typedef struct saga_checkpoint {
    const char *path;
    bool reading;
    bool failed;             /* from here on nothing is written, and what is
                              * read is zero */
    uint64_t sum;            /* of what was written */
    saga_output out;
    saga_bytes bytes;
    saga_cursor rest;
} saga_checkpoint;

/* Begins to write or to read; path must outlive the checkpoint. What is not a
 * checkpoint of this version of the program, is damaged or cut short cannot be
 * read. saga_checkpoint_close ends what was begun. */
bool saga_checkpoint_create(saga_checkpoint *c, const char *path,
                            saga_error *error);
bool saga_checkpoint_open(saga_checkpoint *c, const char *path,
                          saga_error *error);

/* Tells whether bytes begin like a checkpoint, of any version. */
bool saga_checkpoint_is(const uint8_t *bytes, size_t nbytes);

/* Writes nbytes to the file, or reads them from it. */
void saga_checkpoint_walk(saga_checkpoint *c, void *data, size_t nbytes);

/* Walks over a number that must be the same in both directions. */
void saga_checkpoint_expect(saga_checkpoint *c, uint64_t value);

/* Returns false if any of it failed, or if ok is false: then no file was
 * written, or what was read does not hold together. */
bool saga_checkpoint_close(saga_checkpoint *c, bool ok, saga_error *error);

/* Digests by FNV-1a of 64 bits, to notice damage and change; begin with
 * SAGA_DIGEST_START. The digest of two pieces is that of the whole. */
#define SAGA_DIGEST_START 0xcbf29ce484222325u
uint64_t saga_digest(uint64_t sum, const void *data, size_t nbytes);

#endif
