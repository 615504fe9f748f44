/* SPDX-License-Identifier: MIT
 *
 * A file is written as a whole or not at all. Data goes to a temporary file
 * next to it, NAME.saga-part-P-N (the part), which is locked as long as its
 * writer lives, and is renamed when it is complete. A part without a lock is
 * left from a run that was killed; the next one that writes to NAME removes it.
 *
 * A folder is made in the same way.
 *
 * Links are followed, and their target is replaced. Anything except a regular
 * file (a device, a pipe) is written directly. A new file gets permissions by
 * umask, a replaced one keeps its own.
 */
#ifndef SAGA_OUTPUT_H
#define SAGA_OUTPUT_H

#include "error.h"

#include <stdint.h>
#include <stdio.h>

/* Between NAME and the numbers of a part. */
#define SAGA_OUTPUT_MARK ".saga-part-"

typedef struct saga_output {
    FILE *file;             /* NULL: not open */
    char *path, *temporary; /* temporary is NULL if there is no part */
    int slot;               /* index in the list of open parts, from 1; 0: not
                             * in it */
} saga_output;

bool saga_output_open(saga_output *out, const char *path, saga_error *error);

/* Opens an output that takes long to write. Returns false with *error set if
 * another process is writing to the same path. Other processes that call this
 * function for the path fail until the file is closed. */
bool saga_output_open_alone(saga_output *out, const char *path,
                            saga_error *error);

/* Flushes to the disk, checks for errors and renames. If anything fails, or ok
 * is false, removes the part and returns false with *error set. */
bool saga_output_close(saga_output *out, bool ok, saga_error *error);

/* Writes a whole file: opens it, writes bytes[0..n) and closes it. */
bool saga_output_write(const char *path, const uint8_t *bytes, size_t n,
                       saga_error *error);

/* Removes the parts of at most 64 open files. It is for a signal handler after
 * which the program ends, and is async-signal-safe. */
void saga_output_abandon(void);

/* Makes a folder that is going to be renamed to `path`, which must not end with
 * a slash. Returns its name, which the caller frees, or NULL with *error set.
 * *lock is a file descriptor that the caller closes after renaming or removing
 * the folder. */
char *saga_output_folder(const char *path, int *lock, saga_error *error);

/* Removes parts of a path left by runs that were killed. Returns true if
 * another process is writing to the path. */
bool saga_output_sweep(const char *path);

#endif
