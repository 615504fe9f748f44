/* SPDX-License-Identifier: MIT
 *
 * A film is a .saga file, watched through the public decoder: what a player
 * would do, in float where a player's user interface is in float.
 *
 * Metres and box units: metres = centre + box units * unit (saga_info).
 */
#ifndef SAGA_EVAL_VIEW_H
#define SAGA_EVAL_VIEW_H

#include "camera.h"
#include "capture.h"
#include "file.h"
#include "saga.h"

/* Seconds on the wall clock since the file was opened. */
typedef struct saga_stage_times {
    double head, segment, view, draw;
    uint32_t n_segments, n_views; /* how often */
} saga_stage_times;

typedef struct saga_film {
    const char *name;        /* for messages; the caller's */
    const uint8_t *bytes;    /* the whole file; the caller's */
    size_t nbytes;
    saga_info info;
    saga_metric metric;
    saga_decoder *dec;
    void *work;
    int64_t segment;         /* the decoded one; -1: none */
    int n_threads;
    double seconds;          /* that decoding a segment may take; 0: any */
    saga_stage_times times;
} saga_film;

/* Opens a file's bytes[0..nbytes), which stay the caller's and must stay as
 * they are until saga_film_close. n_threads of drawing; 0: as many as OpenMP
 * gives. False: *error says why and *film is empty. */
bool saga_film_open(saga_film *film, const char *name, const uint8_t *bytes,
                    size_t nbytes, int n_threads, saga_error *error);

/* Does the same for who is in a hurry: decoding the head, or later a segment,
 * fails after seconds_most. */
bool saga_film_open_within(saga_film *film, const char *name,
                           const saga_bytes *bytes, double seconds_most,
                           saga_error *error);

/* Takes an empty one too. */
void saga_film_close(saga_film *film);

/* Decodes the segment of the time frame_num / frame_den, in frames, if it is
 * not the last one that was; *t is that time in it, for saga_view and the taps.
 */
bool saga_film_seek(saga_film *film, uint32_t frame_num, uint32_t frame_den,
                    int32_t *t, saga_error *error);

/* Draws the time frame_num / frame_den (in frames) into rgb: 8-bit rows
 * without padding, camera->height x camera->width x 3. Pixels do not depend on
 * n_threads. */
bool saga_film_draw(saga_film *film, const saga_camera *camera,
                    uint32_t frame_num, uint32_t frame_den, uint8_t *rgb,
                    saga_error *error);

/* Does the same with depths: camera->height x camera->width, exact. */
bool saga_film_draw_depth(saga_film *film, const saga_camera *camera,
                          uint32_t frame_num, uint32_t frame_den,
                          saga_depth *depth, saga_error *error);

/* Draws colours at a frame and a part of one, 0 to 1, later. */
bool saga_film_draw_late(saga_film *film, const saga_camera *camera,
                         uint32_t frame, double late, uint8_t *rgb,
                         saga_error *error);

/* Sets what the file calls camera `index` of its rig, and its unit of length; a
 * file without names, or with damaged ones, has "" and an unknown unit. */
void saga_film_naming(const saga_film *film, uint32_t index,
                      saga_naming *naming);

/* Gives camera `index` of the file's rig, and the number the capture gave it.
 */
bool saga_film_rig(const saga_film *film, uint32_t index, saga_camera *camera,
                   uint32_t *number, saga_error *error);

#endif
