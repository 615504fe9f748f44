/* SPDX-License-Identifier: MIT */
#include "synth.h"

#include "alloc.h"
#include "error.h"
#include "synth_job.h"

#include <stdio.h>
#include <stdlib.h>
#include <unistd.h>

saga_synth_options saga_synth_defaults(saga_synth_scene scene)
{
    saga_synth_options o = { .scene = scene,
                             .width = 320,
                             .height = 180,
                             .n_cameras = 10,
                             .n_hold_out = 2,
                             .n_frames = 24,
                             .fps = 24.0,
                             .samples = 2,
                             .depth_every = 12,
                             .n_points = 3000,
                             .seed = 1 };
    if (scene == SAGA_SYNTH_RING) {
        o.n_cameras = 14;
        o.n_frames = 32;
        o.fps = 30.0;
        o.samples = 3;
    }
    return o;
}

static bool check_options(const saga_synth_options *o, const char *folder,
                          saga_error *error)
{
    const struct {
        const char *name;
        int value, low, high;
    } ranges[] = {
        { "width", o->width, 8, 4096 },
        { "height", o->height, 8, 4096 },
        { "cameras", o->n_cameras, 2, 99 },
        /* Two cameras at least are left for training. */
        { "held-out cameras", o->n_hold_out, 0, o->n_cameras - 2 },
        { "frames", o->n_frames, 1, 100000 },
        { "samples per axis", o->samples, 1, 8 },
        { "depth every", o->depth_every, 0, 100000 },
        { "points", o->n_points, 0, 1000000 },
    };
    for (size_t i = 0; i < sizeof ranges / sizeof ranges[0]; i++) {
        char remedy[64];
        (void)snprintf(remedy, sizeof remedy, "use %d to %d", ranges[i].low,
                       ranges[i].high);
        if (ranges[i].value < ranges[i].low || ranges[i].value > ranges[i].high)
            return saga_fail(error, folder, remedy, "%s: %d is out of range",
                             ranges[i].name, ranges[i].value);
    }
    if (!(o->fps > 0.0 && o->fps <= 10000.0))
        return saga_fail(error, folder, "use more than 0, up to 10000",
                         "frame rate %g is out of range", o->fps);
    return true;
}

static bool fill_folder(saga_synth_job *job)
{
    if (!saga_synth_make_folders(job) || !saga_synth_write_pictures(job) ||
        !saga_synth_write_points(job) || !saga_synth_write_json(job))
        return false;
    /* The capture gets its name only once it is complete. */
    return rename(job->folder, job->target) == 0 ||
           saga_fail_errno(job->error, job->target,
                           "remove it or choose "
                           "another name",
                           "exists already");
}

bool saga_synth_write(const char *folder, const saga_synth_options *options,
                      saga_error *error)
{
    /* Options and cameras come first, since they write nothing. */
    saga_synth_job job = { .options = options,
                           .error = error,
                           .target = folder,
                           .first_failed = INT32_MAX };
    *error = (saga_error){ "" };
    if (!check_options(options, folder, error) || !saga_synth_is_free(&job))
        return false;
    job.views = saga_calloc((size_t)options->n_cameras, sizeof *job.views,
                            folder, error);
    if (!job.views)
        return false;
    for (int i = 0; i < options->n_cameras; i++)
        saga_synth_view(options, i, &job.views[i]);
    /* The folder has a temporary name and is removed if filling it fails. */
    bool ok = saga_synth_begin_folder(&job);
    if (ok) {
        ok = fill_folder(&job);
        if (!ok)
            saga_synth_remove(&job);
        close(job.lock);
    }
    free(job.folder);
    free(job.views);
    return ok;
}
