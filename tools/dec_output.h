/* SPDX-License-Identifier: MIT
 *
 * A picture is written into a temporary file, the part, in the same folder. The
 * part is renamed when it is complete, as all output of saga is. Devices and
 * pipes are written directly.
 */
#ifndef DEC_OUTPUT_H
#define DEC_OUTPUT_H

#include <limits.h>
#include <stdio.h>

typedef struct {
    FILE *f;
    char path[PATH_MAX]; /* with links resolved */
    char part[PATH_MAX]; /* empty if the file is written directly */
} dec_output;

/* Opens out->f, whose contents will become the file `name`. Returns 0, or -1
 * with errno set. */
int dec_output_open(dec_output *out, const char *name);

/* Closes out->f. If `whole` is true, the part is renamed to its path, else it
 * is removed. Returns 0, or -1 with errno set. */
int dec_output_close(dec_output *out, int whole);

#endif
