/* SPDX-License-Identifier: MIT
 *
 * Output appears whole or not at all. A file is written under another name
 * beside its own, NAME.saga-part-P-N, which is locked as long as its writer
 * lives, and renamed when it is complete. A part that nobody has locked is left
 * from a run that was killed; whoever writes to NAME next removes it.
 *
 * A folder is made in the same way.
 *
 * A link is followed: what it names is replaced. What is no regular file (a
 * device, a pipe) is written directly. A new file has the permissions that
 * umask leaves it, one that is replaced keeps its own.
 */
#ifndef SAGA_OUTPUT_H
#define SAGA_OUTPUT_H

#include "error.h"

#include <stdio.h>

typedef struct saga_output {
    FILE *file;              /* NULL: not open */
    char *path, *temporary;  /* temporary is NULL where there is no part */
    int slot;                /* among the parts of this program, from 1 */
} saga_output;

bool saga_output_open(saga_output *out, const char *path, saga_error *error);

/* Does the same for a file that takes long: fails while another process writes
 * to that path, and has others fail who call this until it is closed. */
bool saga_output_open_alone(saga_output *out, const char *path,
                            saga_error *error);

/* Flushes to the disk, checks and renames; on any failure (or ok == false) the
 * part is removed and false returned. */
bool saga_output_close(saga_output *out, bool ok, saga_error *error);

/* Removes the parts of all files that are open, of 64 of them at most. For a
 * signal handler, after which the program ends: it does nothing that such a one
 * must not do. */
void saga_output_abandon(void);

/* Makes a folder that will become `path`, which must not end with a slash, and
 * returns its name (free it; NULL on failure). *lock is a file descriptor: to
 * be closed when the folder was renamed or removed. */
char *saga_output_folder(const char *path, int *lock, saga_error *error);

/* Removes what killed runs left of a path. Returns true if somebody else is
 * writing to it. */
bool saga_output_sweep(const char *path);

#endif
