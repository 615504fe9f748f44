/* SPDX-License-Identifier: MIT
 *
 * Finds how long a camera takes from its first row to its last, beyond what
 * the other cameras of a film take. The film tells where things are at any
 * moment; what a row of a captured picture is off the film's, by what changes
 * there in a frame, is how late the row was read
 * (docs/lab/rolling-shutter.md).
 */
#ifndef SAGA_SHUTTER_H
#define SAGA_SHUTTER_H

#include "capture.h"
#include "view.h"

/* A sum is left out at a time, to learn how sure the result is. */
enum { SAGA_SHUTTER_GROUPS = 8 };

/* Sums over samples that move: d is their change in a frame, s the same times
 * the height of the row, -1/2 to 1/2, e what is captured less what is drawn. */
typedef struct saga_shutter_sums {
    double dd, ds, ss, de, se;
} saga_shutter_sums;

/* The sums of a camera; zero it, add. */
typedef struct saga_shutter {
    saga_shutter_sums pictures[SAGA_SHUTTER_GROUPS]; /* in turn, */
    saga_shutter_sums strips[SAGA_SHUTTER_GROUPS];   /* from left to right */
    int n_pictures;
} saga_shutter;

/* Pictures of a film at the time of a captured one, and half a frame before
 * and after it: (height, width, 3). */
typedef struct saga_shutter_drawn {
    const uint8_t *before, *at, *after;
} saga_shutter_drawn;

/* Adds a captured picture, (height, width, 3). */
void saga_shutter_add(saga_shutter *to, const uint8_t *truth,
                      const saga_shutter_drawn *drawn, int width, int height);

/* A view of a capture, and what is the same in a film: its camera, and the
 * frame that shows the capture's first. */
typedef struct saga_shutter_view {
    const saga_capture *capture;
    int view;
    saga_camera camera;
    int first;
} saga_shutter_view;

/* Draws and adds up to n pictures of the view, each half a frame from both ends
 * of the capture or more. */
bool saga_shutter_look(saga_shutter *to, saga_film *film,
                       const saga_shutter_view *from, int n,
                       saga_error *error);

/* The findings on a camera. */
typedef struct saga_shutter_found {
    double readout;          /* frames by which its last row is read after the
                              * first, below 0: before it; less the median of
                              * all cameras, whose part the film has taken on;
                              * NaN where too little moves */
    double spread;           /* its standard error; NaN likewise */
    bool shows;              /* it is more than a film's own errors make, and
                              * half of what any other camera's is */
} saga_shutter_found;

/* Returns what was found of n >= 1 cameras, which free() frees; NULL where
 * memory is short. */
saga_shutter_found *saga_shutter_find(const saga_shutter *of, int n,
                                      saga_error *error);

#endif
