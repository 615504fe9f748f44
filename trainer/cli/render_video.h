/* SPDX-License-Identifier: MIT
 *
 * Encodes pictures as a video file with the program ffmpeg, in BT.709 of
 * limited range: H.264 and AAC in MP4, which every player supports; with
 * opacity, VP9 and Opus in WebM for browsers, or ProRes 4444 and AAC in MOV for
 * editing. The first two are lossy and meant for watching.
 */
#ifndef SAGA_RENDER_VIDEO_H
#define SAGA_RENDER_VIDEO_H

#include "child.h"
#include "output.h"

/* The sound of a film, which lies inside a saga file. */
typedef struct saga_film_sound {
    const char *file; /* NULL: no sound */
    uint64_t offset;
    uint32_t nbytes;
    double start; /* seconds after the first picture; may be
                   * negative */
} saga_film_sound;

typedef struct saga_film_writer {
    saga_output out;
    saga_child ffmpeg;
    size_t picture_nbytes;
} saga_film_writer;

/* The pictures and the sound of a film. */
typedef struct saga_film_plan {
    int width, height, n_pictures;
    bool opacity; /* the pictures are RGBA */
    double fps;
    saga_film_sound sound; /* it is cut where the pictures end */
} saga_film_plan;

/* Tells whether a name is that of a film, which has opacity or not. */
bool saga_film_has_name(const char *path, bool opacity);

bool saga_film_writer_open(saga_film_writer *w, const char *path,
                           const saga_film_plan *plan, saga_error *error);
/* Adds a picture, (height, width, 3 or 4). */
bool saga_film_writer_add(saga_film_writer *w, const uint8_t *pixels,
                          saga_error *error);
/* Ends the video. The file appears if ok and ffmpeg succeeded; otherwise it
 * does not, and false is returned. A writer of zeros, which was never opened,
 * is allowed. */
bool saga_film_writer_close(saga_film_writer *w, bool ok, saga_error *error);

#endif
