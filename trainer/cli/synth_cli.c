/* SPDX-License-Identifier: MIT
 *
 * saga synth writes a built-in scene as a capture.
 */
#include "cli.h"
#include "commands.h"
#include "synth.h"

#include <math.h>
#include <stddef.h>
#include <stdio.h>
#include <string.h>

#define NAMES "use room or ring"

typedef struct {
    const char *scene;
    /* Values that mean the scene's default: a size of 0, numbers below 0, an
     * fps of NaN. */
    saga_cli_pair size;
    int cameras, hold_out, frames, samples, depth_every, points, seed, threads;
    double fps;
    bool exr, masks, quiet;
} options;

static bool find_scene(saga_synth_scene *scene, const char *name)
{
    *scene = strcmp(name, "ring") == 0 ? SAGA_SYNTH_RING : SAGA_SYNTH_ROOM;
    return *scene == SAGA_SYNTH_RING || strcmp(name, "room") == 0;
}

static int or_default(int given, int standard)
{
    return given < 0 ? standard : given;
}

static saga_synth_options resolve(const options *o, saga_synth_scene scene)
{
    saga_synth_options s = saga_synth_defaults(scene);

    s.width = o->size.a ? o->size.a : s.width;
    s.height = o->size.b ? o->size.b : s.height;
    s.n_cameras = or_default(o->cameras, s.n_cameras);
    s.n_hold_out = or_default(o->hold_out, s.n_hold_out);
    s.n_frames = or_default(o->frames, s.n_frames);
    s.samples = or_default(o->samples, s.samples);
    s.depth_every = or_default(o->depth_every, s.depth_every);
    s.n_points = or_default(o->points, s.n_points);
    s.seed = (uint32_t)or_default(o->seed, (int)s.seed);
    s.fps = isnan(o->fps) ? s.fps : o->fps;
    s.exr = o->exr;
    s.masks = o->masks;
    s.n_threads = o->threads;
    return s;
}

static int write(const char *folder, const options *o)
{
    saga_meter meter = { .quiet = o->quiet };
    saga_synth_scene scene;
    saga_synth_options s;
    saga_error error = { "" };
    bool ok;

    if (!find_scene(&scene, o->scene))
        return saga_cli_error(SAGA_EXIT_USAGE,
                              "synth: there is no scene %s; " NAMES, o->scene);
    s = resolve(o, scene);
    s.progress = saga_meter_progress;
    s.progress_user = &meter;
    ok = saga_synth_write(folder, &s, &error);
    saga_meter_end(&meter);
    if (!ok)
        return saga_cli_error(SAGA_EXIT_USAGE, "synth: %s", error.message);
    saga_cli_print("%s: %d cameras, %d of them held out, %d frames of %d x %d "
                   "at %g per second",
                   folder, s.n_cameras, s.n_hold_out, s.n_frames, s.width,
                   s.height, s.fps);
    return SAGA_EXIT_OK;
}

static int run_synth(int argc, char **argv)
{
    options o = { .scene = "room",
                  .cameras = -1,
                  .hold_out = -1,
                  .frames = -1,
                  .samples = -1,
                  .depth_every = -1,
                  .points = -1,
                  .seed = -1,
                  .fps = (double)NAN };
    const char *folder;
    int status = saga_cli_parse(&saga_command_synth, &o, &folder, argc, argv);

    if (status != SAGA_CLI_GO_ON)
        return status;
    status = saga_cli_threads("synth", o.threads);
    return status ? status : write(folder, &o);
}

static const saga_cli_option option_list[] = {
    { "--scene", "room|ring",
      "the room, seen from the front (default), or the ring,\n"
      "with cameras all round and motion that is hard to code",
      saga_cli_text, offsetof(options, scene), 0, 0 },
    { "--size", "WxH",
      "width and height of a picture in pixels (default 320x180)",
      saga_cli_size, offsetof(options, size), 8, 4096 },
    { "--cameras", "N",
      "number of cameras (default 10 on an arc; for the ring 14\n"
      "all round)",
      saga_cli_int, offsetof(options, cameras), 2, 99 },
    { "--hold-out", "N", "number of cameras to keep from training (default 2)",
      saga_cli_int, offsetof(options, hold_out), 0, 97 },
    { "--frames", "N", "number of frames (default 24, ring 32)", saga_cli_int,
      offsetof(options, frames), 1, 100000 },
    { "--fps", "F", "frames per second (default 24, ring 30)", saga_cli_real,
      offsetof(options, fps), 0, 0 },
    { "--samples", "N", "samples per pixel along each axis (default 2, ring 3)",
      saga_cli_int, offsetof(options, samples), 1, 8 },
    { "--depth-every", "N",
      "write true depth for every Nth frame; 0 for none (default\n"
      "12)",
      saga_cli_int, offsetof(options, depth_every), 0, 100000 },
    { "--points", "N",
      "number of points in points.ply, as structure from motion\n"
      "would find them (default 3000)",
      saga_cli_int, offsetof(options, points), 0, 1000000 },
    { "--seed", "N",
      "seed of the points, and for the ring also of its colours,\n"
      "shapes and motions (default 1)",
      saga_cli_int, offsetof(options, seed), 0, INT32_MAX },
    { "--exr", NULL, "write pictures as EXR instead of PNG", saga_cli_flag,
      offsetof(options, exr), 0, 0 },
    { "--masks", NULL,
      "write masks of a subject: the runner with baton and ball,\n"
      "or what stands on the room's bench and floor",
      saga_cli_flag, offsetof(options, masks), 0, 0 },
    { "--threads", "N",
      "number of threads (default: all cores); the files do not\n"
      "depend on it",
      saga_cli_int, offsetof(options, threads), 1, 1024 },
    SAGA_CLI_QUIET(options, quiet)
};

const saga_command saga_command_synth = {
    "synth",
    "DIR",
    1,
    "renders a built-in scene as a capture",
    "Renders a small moving scene with exactly known cameras into a new\n"
    "folder: transforms.json, pictures, depth maps and points.ply. The room\n"
    "has things that rotate, that appear, that are thin and that are glossy.\n"
    "In the ring somebody runs and throws a ball, things come and go from one\n"
    "picture to the next, and displays change their picture in every frame.\n"
    "The same options give the same bytes.\n",
    option_list,
    (int)(sizeof option_list / sizeof option_list[0]),
    run_synth,
    NULL
};
