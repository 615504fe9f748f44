/* SPDX-License-Identifier: MIT
 *
 * Cuts and joins saga files at segments, without decoding. A segment depends
 * only on the head, so it may be moved to any file with the same head; higher
 * layers may be left out as well. Only the segments' numbers, frames, lengths
 * and checksums are written anew.
 */
#ifndef SAGA_SPLICE_H
#define SAGA_SPLICE_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

/* Frames first..end-1 of a file; segments must begin at `first` and end at
 * `end`. */
typedef struct saga_splice_part {
    const char *name;     /* name of the file, for messages */
    const uint8_t *bytes; /* the whole file; owned by the caller */
    size_t nbytes;
    uint32_t first, end; /* end 0: the end of the file */
    uint32_t n_layers;   /* the layers 0..n_layers-1 are taken; 0: all */
} saga_splice_part;

/* Makes the file that shows n_parts >= 1 parts one after another. The caller
 * releases *bytes with free(). The maxima in its head are those of its
 * segments, so joining all parts of a file that `saga encode` wrote gives
 * exactly that file. Names and exposures of the cameras and the viewing volume
 * are those of the first part. The sound is kept only if one part is the whole
 * film, and the volume's quality is unknown if layers are left out.
 * Fails if a part is damaged, if its frames do not begin or end with a segment,
 * if it has fewer layers than wanted, or if heads or networks differ; *error
 * says which, and *bytes is NULL. */
bool saga_splice(uint8_t **bytes, size_t *n, const saga_splice_part *part,
                 int n_parts, saga_error *error);

#endif
