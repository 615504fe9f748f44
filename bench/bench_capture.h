/* SPDX-License-Identifier: MIT
 *
 * A capture for benchmarks: two views of the built-in room at two times.
 */
#ifndef BENCH_CAPTURE_H
#define BENCH_CAPTURE_H

#include "capture_load.h"
#include "synth.h"

#include <stdio.h>
#include <stdlib.h>

/* Renders the built-in room into a temporary folder, and loads it. */
static inline saga_capture bench_capture(int width, int height)
{
    saga_synth_options s = saga_synth_defaults(SAGA_SYNTH_ROOM);
    const saga_capture_options o = saga_capture_defaults();
    char folder[] = "/tmp/bench_train_XXXXXX", remove[64];
    saga_capture c = { 0 };
    saga_error e = { "" };

    s.width = width;
    s.height = height;
    s.n_cameras = s.n_frames = 2;
    s.n_hold_out = s.depth_every = 0;
    s.samples = 1;
    if (!mkdtemp(folder) || !saga_synth_write(folder, &s, &e) ||
        !saga_capture_load(&c, folder, &o, &e))
        goto failed;
    snprintf(remove, sizeof remove, "rm -r %s", folder);
    if (system(remove) == 0)
        return c;
failed:
    fprintf(stderr, "bench_table: %s\n", e.message);
    exit(1);
}

#endif
