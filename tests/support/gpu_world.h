/* SPDX-License-Identifier: MIT
 *
 * A device and the pictures of a small capture, for tests of what a device
 * draws and learns.
 */
#ifndef GPU_WORLD_H
#define GPU_WORLD_H

#include "pictures.h"
#include "synth_capture.h"
#include "test_device.h"
#include "tiny_training.h"

enum { W = 90, H = 52, VIEWS = 5, FRAMES = 4 };

typedef struct {
    saga_gpu *gpu;
    saga_capture capture;
    saga_pictures pictures;
} world;

static inline int set_up_world(void **state)
{
    saga_synth_options s = synth_options(W, H, VIEWS, FRAMES, 120);
    world *const w = zeroed(1, sizeof *w);

    w->gpu = open_test_device();
    s.depth_every = 1;
    w->capture = tiny_capture(&s);
    assert_done(saga_pictures_init(&w->pictures, &w->capture, &error));
    *state = w;
    return 0;
}

static inline int tear_down_world(void **state)
{
    world *const w = *state;

    saga_gpu_close(w->gpu);
    saga_pictures_free(&w->pictures);
    saga_capture_free(&w->capture);
    free(w);
    return 0;
}

/* For a test whose state is the world; it is skipped without a device. */
static inline world *world_of(void **state)
{
    world *const w = *state;

    if (!w->gpu)
        skip();
    return w;
}

#endif
