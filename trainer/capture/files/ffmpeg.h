/* SPDX-License-Identifier: MIT
 *
 * The one place that starts ffmpeg and ffprobe. Files may come from strangers,
 * so every input is read under one list of protocols (files and pipes) and one
 * list of containers that hold the media themselves. A playlist, which names
 * other files or addresses, is refused whatever its name is.
 */
#ifndef SAGA_FFMPEG_H
#define SAGA_FFMPEG_H

#include "child.h"

typedef struct saga_ffmpeg_input {
    const char *path;         /* NULL: standard input */
    const char *format;       /* its container; NULL: any of the list */
    const char *const *words; /* more options of the input, then NULL; may be
                               * NULL */
    uint64_t offset, nbytes;  /* the part of the file that is the input; 0, 0:
                               * all of it */
} saga_ffmpeg_input;

typedef struct saga_ffmpeg {
    const char *program;         /* "ffmpeg" or "ffprobe" */
    saga_ffmpeg_input inputs[2]; /* the second is used if it has a path */
    const char *const *words;    /* the options after the inputs, then NULL */
    const char *const *last;     /* what follows these; may be NULL */
} saga_ffmpeg;

/* Starts the program. It reads its standard input if that is its first input;
 * otherwise this process reads its standard output. */
bool saga_ffmpeg_start(saga_child *child, const saga_ffmpeg *job,
                       saga_error *error);

/* Reports that an input could not be read, with the child's last message, or
 * with the name of the format if it is not on the list. `what` says what
 * failed. Returns false. */
bool saga_ffmpeg_refuse(const saga_child *child, const char *path,
                        const char *remedy, const char *what,
                        saga_error *error);

#endif
