/* SPDX-License-Identifier: MIT
 *
 * saga synth: the built-in scene, as a capture.
 */
#include "cli.h"
#include "commands.h"
#include "synth.h"

#include <stddef.h>
#include <stdio.h>

typedef struct {
    saga_cli_pair size;
    int cameras, hold_out, frames, samples, depth_every, points, seed,
        threads;
    double fps;
    bool exr;
} options;

static options defaults(void)
{
    const saga_synth_options d = saga_synth_defaults();

    return (options){
        .size = { d.width, d.height }, .cameras = d.n_cameras,
        .hold_out = d.n_hold_out, .frames = d.n_frames,
        .samples = d.samples, .depth_every = d.depth_every,
        .points = d.n_points, .seed = (int)d.seed, .fps = d.fps,
        .exr = d.exr
    };
}

static int write(const char *folder, const options *o)
{
    saga_meter meter = { 0 };
    saga_synth_options s = {
        .width = o->size.a, .height = o->size.b, .n_cameras = o->cameras,
        .n_hold_out = o->hold_out, .n_frames = o->frames, .fps = o->fps,
        .samples = o->samples, .depth_every = o->depth_every,
        .n_points = o->points, .seed = (uint32_t)o->seed, .exr = o->exr,
        .n_threads = o->threads, .progress = saga_meter_progress,
        .progress_user = &meter
    };
    saga_error error = { "" };
    const bool ok = saga_synth_write(folder, &s, &error);

    saga_meter_end(&meter);
    if (!ok)
        return saga_cli_error(SAGA_EXIT_USAGE, "synth: %s", error.message);
    printf("%s: %d cameras, %d of them held out, %d frames of %d x %d at %g "
           "per second\n", folder, s.n_cameras, s.n_hold_out, s.n_frames,
           s.width, s.height, s.fps);
    return SAGA_EXIT_OK;
}

static int run(int argc, char **argv)
{
    options o = defaults();
    const char *folder;
    const int status = saga_cli_parse(&saga_command_synth, &o, &folder, argc,
                                      argv);

    return status == SAGA_CLI_GO_ON ? write(folder, &o) : status;
}

static const saga_cli_option option_list[] = {
    { "--size", "WxH", "pixels of a picture (default 320x180)", saga_cli_size,
      offsetof(options, size), 8, 4096 },
    { "--cameras", "N", "on an arc (default 10)", saga_cli_int,
      offsetof(options, cameras), 2, 99 },
    { "--hold-out", "N", "cameras not to be trained on (default 2)",
      saga_cli_int, offsetof(options, hold_out), 0, 97 },
    { "--frames", "N", "frames (default 24)", saga_cli_int,
      offsetof(options, frames), 1, 100000 },
    { "--fps", "F", "frames per second (default 24)", saga_cli_real,
      offsetof(options, fps), 0, 0 },
    { "--samples", "N", "per pixel and axis (default 2)", saga_cli_int,
      offsetof(options, samples), 1, 8 },
    { "--depth-every", "N", "true depth for every Nth frame; 0: none (default "
      "12)", saga_cli_int, offsetof(options, depth_every), 0, 100000 },
    { "--points", "N", "points as structure from motion finds them (default "
      "3000)", saga_cli_int, offsetof(options, points), 0, 1000000 },
    { "--seed", "N", "of the points' places and noise", saga_cli_int,
      offsetof(options, seed), 0, INT32_MAX },
    { "--exr", NULL, "pictures as EXR, not PNG", saga_cli_flag,
      offsetof(options, exr), 0, 0 },
    { "--threads", "N", "threads (default: all cores); no effect on the files",
      saga_cli_int, offsetof(options, threads), 1, 1024 }
};

const saga_command saga_command_synth = {
    "synth", "DIR", 1,
    "the built-in scene, rendered as a capture",
    "Renders a small moving scene (a textured room, something that rotates,\n"
    "something that appears, something thin, something glossy) with exact\n"
    "cameras into a new folder: transforms.json, pictures, depth, points.ply.\n"
    "The same options give the same bytes.\n",
    option_list, (int)(sizeof option_list / sizeof option_list[0]), run
};
