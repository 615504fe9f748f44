/* SPDX-License-Identifier: MIT
 *
 * A film is a .saga file opened through the public decoder, as a player would
 * open it. Cameras are in float, as in a player's user interface.
 *
 * Metres and box units: metres = centre + box units * unit (saga_info).
 */
#ifndef SAGA_EVAL_VIEW_H
#define SAGA_EVAL_VIEW_H

#include "camera.h"
#include "capture.h"
#include "file.h"
#include "saga.h"

/* Wall-clock seconds spent in each stage since the file was opened. */
typedef struct saga_stage_times {
    double head, segment, view, draw;
    uint32_t n_segments, n_views; /* number of segments decoded, and of views
                                   * drawn */
} saga_stage_times;

typedef struct saga_film {
    const char *name;     /* for messages; owned by the caller */
    const uint8_t *bytes; /* the whole file; owned by the caller */
    size_t nbytes;
    saga_info info;
    saga_metric metric;
    saga_decoder *dec;
    void *work;
    int64_t segment; /* the decoded segment; -1: none */
    int n_threads;
    double seconds; /* limit for decoding the head or a segment; 0: none */
    saga_stage_times times;
} saga_film;

/* Opens a file's bytes[0..nbytes), which are owned by the caller and must stay
 * unchanged until saga_film_close. n_threads is the number of threads for
 * drawing; 0: OpenMP's default. If it fails, *error says why and *film is
 * empty. */
bool saga_film_open(saga_film *film, const char *name, const uint8_t *bytes,
                    size_t nbytes, int n_threads, saga_error *error);

/* Opens a film with a time limit: decoding the head, or later a segment, fails
 * if it takes longer than seconds_most. */
bool saga_film_open_within(saga_film *film, const char *name,
                           const saga_bytes *bytes, double seconds_most,
                           saga_error *error);

/* Closes a film; an empty film is allowed. */
void saga_film_close(saga_film *film);

/* Decodes the segment that holds the time frame_num / frame_den, in frames,
 * unless it is the one decoded last. Sets *t to that time in units of the
 * segment, for saga_view and the taps. */
bool saga_film_seek(saga_film *film, uint32_t frame_num, uint32_t frame_den,
                    int32_t *t, saga_error *error);

/* Draws the time frame_num / frame_den (in frames) into rgb: 8-bit rows without
 * padding, camera->height x camera->width x 3. The pixels do not depend on the
 * number of threads. */
bool saga_film_draw(saga_film *film, const saga_camera *camera,
                    uint32_t frame_num, uint32_t frame_den, uint8_t *rgb,
                    saga_error *error);

/* Draws as saga_film_draw does, but sets exact depths instead of colours:
 * camera->height x camera->width of them. */
bool saga_film_draw_depth(saga_film *film, const saga_camera *camera,
                          uint32_t frame_num, uint32_t frame_den,
                          saga_depth *depth, saga_error *error);

/* Draw the time that is the fraction `late`, 0 to 1, of a frame after
 * `frame`. */
bool saga_film_draw_late(saga_film *film, const saga_camera *camera,
                         uint32_t frame, double late, uint8_t *rgb,
                         saga_error *error);
bool saga_film_draw_depth_late(saga_film *film, const saga_camera *camera,
                               uint32_t frame, double late, saga_depth *depth,
                               saga_error *error);

/* Sets the name that the file gives camera `index` of its rig, and the file's
 * unit of length. If the file has no names, or damaged ones, the name is "" and
 * the unit unknown. */
void saga_film_naming(const saga_film *film, uint32_t index,
                      saga_naming *naming);

/* Gives a drawn picture of n pixels, rgb, the tone in which camera `index` of
 * the rig filmed. Changes nothing if the file has no exposure for that camera
 * (saga_find_exposure), or a damaged one. */
void saga_film_expose(const saga_film *film, uint32_t index, uint8_t *rgb,
                      size_t n);

/* Sets *index to the camera of the file with a name, or else with the number 3
 * for "3" or "rig:3". */
bool saga_film_find_camera(uint32_t *index, const saga_film *film,
                           const char *name, saga_error *error);

/* Sets camera `index` of the file's rig, and the number it had in the
 * capture. */
bool saga_film_rig(const saga_film *film, uint32_t index, saga_camera *camera,
                   uint32_t *number, saga_error *error);

#endif
