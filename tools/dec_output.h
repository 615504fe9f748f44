/* SPDX-License-Identifier: MIT
 *
 * A picture's file is written beside its place and renamed when it is whole, as
 * all output of saga is. What is no regular file is written directly.
 */
#ifndef DEC_OUTPUT_H
#define DEC_OUTPUT_H

#include <limits.h>
#include <stdio.h>

typedef struct {
    FILE *f;
    char path[PATH_MAX];         /* links followed */
    char part[PATH_MAX];         /* empty: written directly */
} dec_output;

/* Opens out->f for what becomes the file `name`; 0, or -1 with errno. */
int dec_output_open(dec_output *out, const char *name);

/* Closes it. It keeps its place if `whole` says that all was written, and else
 * is removed; 0, or -1 with errno. */
int dec_output_close(dec_output *out, int whole);

#endif
