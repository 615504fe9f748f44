/* SPDX-License-Identifier: MIT
 *
 * A part of a film that is trained in parts has a record beside it, FILE.part,
 * a few lines of text that say which segments of how many it holds. With the
 * records, saga join knows whether a part is missing, is given twice or is from
 * another training. The file itself has no room for that in its format.
 */
#ifndef SAGA_PART_RECORD_H
#define SAGA_PART_RECORD_H

#include "error.h"
#include "splice.h"

#include <stddef.h>
#include <stdint.h>

typedef struct saga_part_record {
    uint32_t first, end; /* the file holds segments first..end-1 */
    uint32_t count;      /* number of segments of the film; 0: there is no
                          * record */
    uint32_t training;   /* digest of the networks, which all parts of
                          * a training share */
} saga_part_record;

/* Writes the record of a file whose bytes these are; r->training is set from
 * them. It is written before the file, since a file without its record would
 * be taken for a whole film. */
bool saga_part_write(const char *file, const uint8_t *bytes, size_t n,
                     const saga_part_record *r, saga_error *error);

/* Reads the record of a file; r->count is 0 if there is none. Fails if it is no
 * record, or that of other bytes. */
bool saga_part_read(saga_part_record *r, const char *file, const uint8_t *bytes,
                    size_t n, saga_error *error);

/* Removes a record that an earlier file of this name has left. */
void saga_part_forget(const char *file);

/* Sorts files into the order of their segments, and sets *all to the segments
 * from the first to the last; all->count is 0, and the order kept, if none of
 * the files has a record. Fails if only some have, if their trainings differ,
 * or if two hold the same segment. Sets `missing` to the segments that no file
 * holds, as text, and *inside to whether some of these are between two files;
 * the text is empty if none is missing. */
bool saga_part_arrange(saga_part_record *all, char *missing, size_t nbytes,
                       bool *inside, saga_splice_part *part, int n_parts,
                       saga_error *error);

#endif
