/* SPDX-License-Identifier: MIT
 *
 * Draws the pictures, masks and depths of the built-in scenes with several
 * threads, and writes them.
 */
#include "synth_job.h"

#include "alloc.h"
#include "error.h"
#include "picture.h"
#include "pose.h"
#include "synth_world.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#else
#define omp_get_max_threads() 1
#endif

uint8_t saga_synth_display(double light)
{
    const double x = sqrt(light > 0.0 ? light : 0.0) * 255.0 + 0.5;
    return x >= 255.0 ? 255 : (uint8_t)x;
}

static void render_pixel(const saga_synth_job *job,
                         const saga_synth_world *world,
                         const saga_source_view *view, const double origin[3],
                         int x, int y, uint8_t *rgb)
{
    const int n = job->options->samples;
    double sum[3] = { 0 };
    for (int k = 0; k < n * n; k++) {
        double d[3], light[3];
        saga_synth_direction(view, x + (k % n + 0.5) / n, y + (k / n + 0.5) / n,
                             d);
        saga_synth_light(world, origin, d, light);
        for (int c = 0; c < 3; c++)
            sum[c] += light[c] < 1.0 ? light[c] : 1.0;
    }
    for (int c = 0; c < 3; c++)
        rgb[c] = saga_synth_display(sum[c] / (n * n));
}

static void render(const saga_synth_job *job, int camera, int frame,
                   uint8_t *rgb)
{
    const saga_source_view *const view = &job->views[camera];
    saga_synth_world world;
    double origin[3];
    saga_synth_world_at(&world, job->options, frame / job->options->fps);
    saga_pose_centre(view->rotation, view->translation, origin);
    for (int y = 0; y < view->height; y++)
        for (int x = 0; x < view->width; x++, rgb += 3)
            render_pixel(job, &world, view, origin, x, y, rgb);
}

/* Draws the mask, as grey RGB: the part of a pixel's samples that the subject
 * takes. */
static void render_mask(const saga_synth_job *job, int camera, int frame,
                        uint8_t *rgb)
{
    const saga_source_view *const view = &job->views[camera];
    const int n = job->options->samples;
    saga_synth_world world;
    double origin[3], d[3];
    saga_synth_world_at(&world, job->options, frame / job->options->fps);
    saga_pose_centre(view->rotation, view->translation, origin);
    for (int y = 0; y < view->height; y++)
        for (int x = 0; x < view->width; x++, rgb += 3) {
            int sum = 0;
            for (int k = 0; k < n * n; k++) {
                saga_synth_direction(view, x + (k % n + 0.5) / n,
                                     y + (k / n + 0.5) / n, d);
                sum += saga_synth_is_subject(&world, origin, d);
            }
            memset(rgb, (255 * sum + n * n / 2) / (n * n), 3);
        }
}

static void render_depth(const saga_synth_job *job, int camera, int frame,
                         float *depth)
{
    const saga_source_view *const view = &job->views[camera];
    saga_synth_world world;
    double origin[3], d[3];
    saga_synth_world_at(&world, job->options, frame / job->options->fps);
    saga_pose_centre(view->rotation, view->translation, origin);
    for (int y = 0; y < view->height; y++)
        for (int x = 0; x < view->width; x++) {
            saga_synth_direction(view, x + 0.5, y + 0.5, d);
            *depth++ = (float)saga_synth_look(&world, origin, d).distance;
        }
}

static bool write_picture(const saga_synth_job *job, int camera, int frame,
                          saga_error *error)
{
    const int w = job->options->width, h = job->options->height;
    const size_t n = (size_t)w * (size_t)h;
    const bool exr = job->options->exr;
    char path[SAGA_SYNTH_PATH];
    uint8_t *const rgb = saga_alloc(n, 3, job->target, error);
    float *const depth = saga_alloc(n, sizeof *depth, job->target, error);
    bool ok = rgb && depth;
    if (ok) {
        render(job, camera, frame, rgb);
        saga_synth_path(job, "images", exr ? "exr" : "png", camera, frame,
                        path);
        ok = exr ? saga_exr_write(path, w, h, rgb, error)
                 : saga_png_write(path, w, h, rgb, error);
    }
    if (ok && job->options->masks) {
        render_mask(job, camera, frame, rgb);
        saga_synth_path(job, "masks", "png", camera, frame, path);
        ok = saga_png_write(path, w, h, rgb, error);
    }
    /* Depth is written for every depth_every-th frame only. */
    if (ok && saga_synth_has_depth(job->options, frame)) {
        render_depth(job, camera, frame, depth);
        saga_synth_path(job, "depth", "exr", camera, frame, path);
        ok = saga_exr_write_depth(path, w, h, depth, error);
    }
    free(rgb);
    free(depth);
    return ok;
}

static void picture_done(saga_synth_job *job, int item, bool ok,
                         const saga_error *error)
{
    const saga_synth_options *const o = job->options;
#pragma omp critical(saga_synth)
    {
        job->n_done++;
        /* The error of the lowest item is kept, whichever came first. A cancel
         * counts as item -1, so it is below all of them. */
        if (!ok && item < job->first_failed) {
            job->first_failed = item;
            *job->error = *error;
        }
        if (job->first_failed == INT32_MAX && o->progress &&
            !o->progress(o->progress_user,
                         (double)job->n_done / (o->n_cameras * o->n_frames),
                         "rendering")) {
            job->first_failed = -1;
            saga_fail(job->error, job->target, NULL, "cancelled");
        }
    }
}

static bool picture_skipped(saga_synth_job *job, int item)
{
    bool skip;
#pragma omp critical(saga_synth)
    /* Later pictures need not be made. Earlier ones continue, since one of them
     * may fail, and its error would then be the one to report. */
    skip = job->first_failed < item;
    return skip;
}

bool saga_synth_write_pictures(saga_synth_job *job)
{
    const saga_synth_options *const o = job->options;
    const int n_threads = o->n_threads > 0 ? o->n_threads
                                           : omp_get_max_threads();
#pragma omp parallel for schedule(dynamic, 1) num_threads(n_threads)
    for (int i = 0; i < o->n_cameras * o->n_frames; i++) {
        saga_error error = { "" };
        if (picture_skipped(job, i))
            continue;
        const bool ok = write_picture(job, i / o->n_frames, i % o->n_frames,
                                      &error);
        picture_done(job, i, ok, &error);
    }
    return job->first_failed == INT32_MAX;
}
