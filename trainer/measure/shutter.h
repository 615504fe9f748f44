/* SPDX-License-Identifier: MIT
 *
 * Estimates a camera's readout time, from its first row to its last, beyond
 * that of the other cameras. The film shows where things are at any moment. The
 * difference between a captured row and the film's row, divided by what changes
 * there in a frame, tells how late the row was read
 * (docs/lab/rolling-shutter.md).
 */
#ifndef SAGA_SHUTTER_H
#define SAGA_SHUTTER_H

#include "capture.h"
#include "view.h"

/* Samples are divided into groups. Each group is left out once, to estimate the
 * error of the result (jackknife). */
enum { SAGA_SHUTTER_GROUPS = 8 };

/* Sums of products over samples that move: d is the change of a sample in a
 * frame, s is d times the height of its row (-1/2 to 1/2), e is the captured
 * value less the drawn value. */
typedef struct saga_shutter_sums {
    double dd, ds, ss, de, se;
} saga_shutter_sums;

/* The sums for one camera: initialise with zeros, then add pictures. */
typedef struct saga_shutter {
    saga_shutter_sums pictures[SAGA_SHUTTER_GROUPS]; /* pictures are dealt out
                              * in turn */
    saga_shutter_sums strips[SAGA_SHUTTER_GROUPS];   /* vertical strips of the
                              * picture, from left to right */
    int n_pictures;
} saga_shutter;

/* Drawn pictures, (height, width, 3): at the time of a captured picture, and
 * half a frame before and after it. */
typedef struct saga_shutter_drawn {
    const uint8_t *before, *at, *after;
} saga_shutter_drawn;

/* Adds a captured picture, (height, width, 3). */
void saga_shutter_add(saga_shutter *to, const uint8_t *truth,
                      const saga_shutter_drawn *drawn, int width, int height);

/* A view of a capture with its counterpart in the film: its camera, and the
 * film's frame that shows the capture's first. */
typedef struct saga_shutter_view {
    const saga_capture *capture;
    int view;
    saga_camera camera;
    int first;
} saga_shutter_view;

/* Draws and adds up to n pictures of the view, all of them at least half a
 * frame from both ends of the capture. */
bool saga_shutter_look(saga_shutter *to, saga_film *film,
                       const saga_shutter_view *from, int n,
                       saga_error *error);

/* The result for one camera. */
typedef struct saga_shutter_found {
    double readout;          /* frames from reading the first row to reading the
                              * last, negative if the last row is first; less
                              * the median of all cameras, because the film
                              * itself has taken on that part; NaN if too little
                              * moves */
    double spread;           /* standard error of readout; NaN if readout is */
    bool shows;              /* readout is larger than errors of the film can
                              * explain, and at least half of the largest one */
} saga_shutter_found;

/* Returns the results for n >= 1 cameras, which the caller releases with
 * free(); NULL if memory is short. */
saga_shutter_found *saga_shutter_find(const saga_shutter *of, int n,
                                      saga_error *error);

#endif
