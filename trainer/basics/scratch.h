/* SPDX-License-Identifier: MIT
 *
 * Memory whose pages are those of a temporary file. The kernel may write such a
 * page to the disk and drop it at any time, and reads it again when it is used,
 * so that a process may use more of it than the machine has memory. It does not
 * count as anonymous memory.
 *
 * The file has no name once it is open: no other program can cut it short or
 * damage it, no run finds the file of another, and it disappears with the
 * process, however that ends. Its space on the disk is reserved when it is
 * made, so that writing to the memory cannot fail for lack of space. (A disk
 * that fails ends the process by SIGBUS.)
 */
#ifndef SAGA_SCRATCH_H
#define SAGA_SCRATCH_H

#include "error.h"

#include <stdint.h>

typedef struct saga_scratch {
    uint8_t *at; /* (nbytes), all 0 at first; NULL: there is none */
    size_t nbytes;
    int fd; /* of the file */
} saga_scratch;

/* Makes a file without a name in a folder. Returns its descriptor; or -1 with
 * *error set, which says `what` and the remedy `way`. */
int saga_scratch_open(const char *folder, const char *what, const char *way,
                      saga_error *error);
/* Makes nbytes, at least 1, in a file in `folder`. Returns false with *error
 * set, and *scratch empty, if the folder cannot be written or its disk has not
 * enough space. */
bool saga_scratch_make(saga_scratch *scratch, const char *folder,
                       uint64_t nbytes, saga_error *error);
/* Copies n bytes to the memory at `to`. Through the file this takes a tenth of
 * the time of writing to memory whose pages have not been used yet. */
void saga_scratch_copy(const saga_scratch *scratch, uint8_t *to,
                       const uint8_t *from, size_t n);
/* Frees the memory and the file; *scratch may be empty. */
void saga_scratch_free(saga_scratch *scratch);

#endif
