/* SPDX-License-Identifier: MIT
 *
 * Renders a built-in scene as a nerfstudio capture: "room" (synth_room.h), or
 * "ring" (synth_ring.h), which moves hard and has cameras all round.
 *
 *     DIR/transforms.json
 *     DIR/images/camNN/FFFFF.png (or .exr, linear light)
 *     DIR/depth/camNN/FFFFF.exr  for every depth_every-th frame: z at pixel
 *                                centres, in metres
 *     DIR/points.ply             as from structure-from-motion on frame 0 of
 *                                the training cameras: textured places seen
 *                                by at least two, with noise
 *
 * The folder appears whole or not at all. The same options give the same
 * bytes, for any number of threads.
 */
#ifndef SAGA_SYNTH_H
#define SAGA_SYNTH_H

#include "capture.h"

typedef enum saga_synth_scene {
    SAGA_SYNTH_ROOM,
    SAGA_SYNTH_RING
} saga_synth_scene;

typedef struct saga_synth_options {
    saga_synth_scene scene;
    int width, height;       /* 8..4096 */
    int n_cameras;           /* 2..99, on an arc, or all round; heights
                              * alternating */
    int n_hold_out;          /* spread over them; at least 2 remain */
    int n_frames;            /* 1..100000 */
    double fps;
    int samples;             /* per pixel and axis, 1..8 */
    int depth_every;         /* 0: no depth */
    int n_points;            /* 0..1000000; fewer where it is hard */
    uint32_t seed;           /* of the points' places and noise; and of all
                              * that the ring is */
    bool exr;                /* pictures as EXR */
    int n_threads;           /* 0: as many as OpenMP gives */
    saga_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_synth_options;

/* Returns cameras of 320x180, 2 held out, depth every 12th frame, 3,000 points.
 * The room: 10 cameras, 24 frames at 24 fps, 2 x 2 samples; the ring: 14
 * cameras, 32 frames at 30 fps, 3 x 3 samples. */
saga_synth_options saga_synth_defaults(saga_synth_scene scene);

/* folder must not exist, or be empty. */
bool saga_synth_write(const char *folder, const saga_synth_options *options,
                      saga_error *error);

/* Sets name, camera and held_out of a view, without pictures: what a loader
 * finds again. */
void saga_synth_view(const saga_synth_options *options, int index,
                     saga_shot *view);

#endif
