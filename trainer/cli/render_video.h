/* SPDX-License-Identifier: MIT
 *
 * Pictures become a video file through the program ffmpeg: H.264 in MP4, BT.709
 * in limited range, and AAC, which every player takes. Lossy: for watching.
 */
#ifndef SAGA_RENDER_VIDEO_H
#define SAGA_RENDER_VIDEO_H

#include "child.h"
#include "output.h"

/* The sound of a film, in a part of a file. */
typedef struct saga_film_sound {
    const char *file;        /* NULL: none */
    uint64_t offset;
    uint32_t nbytes;
    double start;            /* seconds after the first picture, or before */
} saga_film_sound;

typedef struct saga_film_writer {
    saga_output out;
    saga_child ffmpeg;
    size_t picture_nbytes;
} saga_film_writer;

/* The pictures and the sound of a film. */
typedef struct saga_film_plan {
    int width, height, n_pictures;
    double fps;
    saga_film_sound sound;   /* cut where the pictures end */
} saga_film_plan;

bool saga_film_writer_open(saga_film_writer *w, const char *path,
                           const saga_film_plan *plan, saga_error *error);
/* rgb is (height, width, 3). */
bool saga_film_writer_add(saga_film_writer *w, const uint8_t *rgb,
                          saga_error *error);
/* The file appears if ok and ffmpeg was content; else it does not, and false
 * is returned. Takes one that was never opened, of zeros. */
bool saga_film_writer_close(saga_film_writer *w, bool ok, saga_error *error);

#endif
