/* SPDX-License-Identifier: MIT
 *
 * Renders a built-in scene as a nerfstudio capture. The scenes are "room"
 * (synth_room.h), and "ring" (synth_ring.h), which has fast motion and cameras
 * all around. The files are:
 *
 *     DIR/transforms.json
 *     DIR/images/camNN/FFFFF.png (or .exr, with linear light)
 *     DIR/depth/camNN/FFFFF.exr  for every depth_every-th frame: z at the
 *                                pixels' centres, in metres
 *     DIR/masks/camNN/FFFFF.png  how much of each pixel is the subject: the
 *                                runner with his baton and ball, or what stands
 *                                on the room's bench and floor
 *     DIR/points.ply             points as from structure from motion on frame
 *                                0 of the training cameras: textured places
 *                                that at least two of them see, with noise
 *
 * The folder appears either completely or not at all. The same options give the
 * same bytes, with any number of threads.
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
    int width, height; /* 8..4096 */
    int n_cameras;     /* 2..99, on an arc or all round, with alternating
                        * heights */
    int n_hold_out;    /* held-out cameras, spread over all; at least 2
                        * others remain */
    int n_frames;      /* 1..100000 */
    double fps;
    int samples;     /* samples per pixel and axis, 1..8 */
    int depth_every; /* frames between two depth maps; 0: no depth */
    int n_points;    /* 0..1000000; fewer if too few places have
                      * texture */
    uint32_t seed;   /* seed of the points' positions and noise; in the
                      * ring, of everything */
    bool exr;        /* pictures as EXR */
    bool masks;      /* write masks of the subject; default false */
    int n_threads;   /* 0: OpenMP's default */
    saga_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_synth_options;

/* Returns the defaults: cameras of 320x180, 2 held out, depth in every 12th
 * frame, 3,000 points. The room has 10 cameras, 24 frames at 24 fps and 2 x 2
 * samples; the ring has 14 cameras, 32 frames at 30 fps and 3 x 3 samples. */
saga_synth_options saga_synth_defaults(saga_synth_scene scene);

/* Writes the capture. The folder must not exist, or must be empty. */
bool saga_synth_write(const char *folder, const saga_synth_options *options,
                      saga_error *error);

/* Sets name, camera and held_out of a view, without pictures, as a loader will
 * find them. */
void saga_synth_view(const saga_synth_options *options, int index,
                     saga_source_view *view);

#endif
