/* SPDX-License-Identifier: MIT
 *
 * The built-in room as a small capture for tests.
 */
#ifndef SYNTH_CAPTURE_H
#define SYNTH_CAPTURE_H

#include "capture_load.h"
#include "synth.h"
#include "testing.h"

/* Returns options for pictures of w x h with one held-out camera, no depths,
 * and one thread. */
static inline saga_synth_options synth_options(int w, int h, int n_cameras,
                                               int n_frames, int n_points)
{
    saga_synth_options o = saga_synth_defaults(SAGA_SYNTH_ROOM);

    o.width = w;
    o.height = h;
    o.n_cameras = n_cameras;
    o.n_hold_out = 1;
    o.n_frames = n_frames;
    o.n_points = n_points;
    o.depth_every = 0;
    o.n_threads = 1;
    return o;
}

/* Writes the capture to a new folder `path`, and loads it with its depths. */
static inline saga_capture synth_capture(const char *path,
                                         const saga_synth_options *s)
{
    saga_capture_options o = saga_capture_defaults();
    saga_capture c = { 0 };

    o.want_depth = s->depth_every > 0;
    assert_done(saga_synth_write(path, s, &error));
    assert_done(saga_capture_load(&c, path, &o, &error));
    return c;
}

#endif
