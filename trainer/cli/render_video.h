/* SPDX-License-Identifier: MIT
 *
 * Pictures become a video file through the program ffmpeg: H.264 in MP4, BT.709
 * in limited range, which every player takes. Lossy: for watching.
 */
#ifndef SAGA_RENDER_VIDEO_H
#define SAGA_RENDER_VIDEO_H

#include "child.h"
#include "output.h"

typedef struct saga_film_writer {
    saga_output out;
    saga_child ffmpeg;
    size_t picture_nbytes;
} saga_film_writer;

/* Takes pictures of width x height, `fps` a second. */
bool saga_film_writer_open(saga_film_writer *w, const char *path, int width,
                           int height, double fps, saga_error *error);
/* rgb is (height, width, 3). */
bool saga_film_writer_add(saga_film_writer *w, const uint8_t *rgb,
                          saga_error *error);
/* The file appears if ok and ffmpeg was content; else it does not, and false
 * is returned. Takes one that was never opened, of zeros. */
bool saga_film_writer_close(saga_film_writer *w, bool ok, saga_error *error);

#endif
