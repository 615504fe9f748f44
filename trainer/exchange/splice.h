/* SPDX-License-Identifier: MIT
 *
 * Files are cut and joined here, a segment at a time and without decoding: a
 * segment needs nothing but the head, so those of one head may stand in any
 * file that has it; nor does a layer. Only numbers, frames, lengths and
 * checksums are written anew.
 */
#ifndef SAGA_SPLICE_H
#define SAGA_SPLICE_H

#include "error.h"

#include <stddef.h>
#include <stdint.h>

/* Frames first..end-1 of a file, which must begin and end with segments. */
typedef struct saga_splice_part {
    const char *name;        /* of the file, for messages */
    const uint8_t *bytes;    /* all of it; the caller's */
    size_t nbytes;
    uint32_t first, end;     /* end 0: to the file's end */
    uint32_t n_layers;       /* number of its layers, the first ones; 0: all */
} saga_splice_part;

/* Gives the file that shows n_parts >= 1 parts one after another: *bytes
 * belongs to the caller (free). Its maxima are those of its segments; so all
 * parts of a file, joined, give its bytes again where `saga encode` made it.
 * Sound is kept where one part is all of its film, and else left out.
 * Fails where a part is damaged, where frames do not begin or end with a
 * segment, where there are fewer layers, and where heads or networks differ:
 * the error says which, and *bytes is NULL. */
bool saga_splice(uint8_t **bytes, size_t *n, const saga_splice_part *part,
                 int n_parts, saga_error *error);

#endif
