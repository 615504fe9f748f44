/* SPDX-License-Identifier: MIT
 *
 * Decodes pictures, masks and depth with several threads, undistorts them, and
 * scales them into the views of a capture.
 */
#include "load_job.h"

#include "alloc.h"
#include "error.h"
#include "picture.h"

#include <stdlib.h>
#include <string.h>

/* ----------------------------------------------------------------- progress */

/* Counts a finished item. If items fail, the error of the lowest one is kept.
 * Items start in order, so that is the same error for any number of threads. */
static void item_done(saga_load_job *job, int item, bool ok,
                      const saga_error *error)
{
#pragma omp critical(saga_load)
    {
        if (!ok && item < job->first_failed) {
            job->first_failed = item;
            *job->error = *error;
        }
        job->n_done++;
        const saga_capture_options *const o = job->options;
        if (job->first_failed == INT32_MAX && o->progress &&
            !o->progress(o->progress_user,
                         (double)job->n_done / job->n_items, "loading")) {
            job->first_failed = -1;
            saga_fail(job->error, job->listing->path, NULL, "cancelled");
        }
    }
}

/* Tells whether an item is skipped, which is so only for items after a failed
 * one. An earlier item may still turn out to be the first that fails. */
static bool item_skipped(saga_load_job *job, int item)
{
    bool skip;
#pragma omp critical(saga_load)
    skip = job->first_failed < item;
    return skip;
}

/* ----------------------------------------------------------------- decoding */

static uint8_t *frame_to_fill(const saga_load_job *job, int v, int k)
{
    const saga_shot *const view = &job->capture->views[v];
    return view->rgb + saga_view_frame_nbytes(view) *
                           (size_t)(view->single ? 0 : k);
}

static bool read_video(saga_load_job *job, int v, const saga_remap *remap,
                       uint8_t *buffer, saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    const int first = s->skip + job->capture->first_frame;
    const int end = first + job->capture->n_frames;
    saga_video video;
    if (!saga_video_open(&video, s->video, &s->info, end, error))
        return false;
    bool ok = true;
    /* Videos are decoded from their start; frames before the first wanted one
     * are dropped. */
    for (int k = 0; ok && k < end; k++) {
        ok = saga_video_next(&video, buffer, error);
        if (ok && k >= first)
            saga_remap_rgb(remap, buffer, frame_to_fill(job, v, k - first));
        /* A cancelled load must not wait for the end of long videos. */
        if (item_skipped(job, v))
            ok = saga_fail(error, s->video, NULL, "stopped");
    }
    return saga_video_close(&video, ok, error);
}

static void load_video(saga_load_job *job, int v)
{
    const saga_source *const s = &job->listing->sources[v];
    saga_error error = { "" };
    saga_remap remap = job->remaps[v];
    uint8_t *const buffer = saga_alloc((size_t)s->width * (size_t)s->height,
                                       3, s->video, &error);
    bool ok = buffer && saga_remap_build(&remap, &s->lens, s->video, &error);
    ok = ok && read_video(job, v, &remap, buffer, &error);
    saga_remap_free(&remap);
    free(buffer);
    item_done(job, v, ok, &error);
}

static void load_picture(saga_load_job *job, int v, int k,
                         const saga_remap *remap)
{
    const saga_source *const s = &job->listing->sources[v];
    const char *const path = s->pictures[job->capture->first_frame + k];
    saga_error error = { "" };
    uint8_t *const buffer =
        saga_alloc((size_t)s->width * (size_t)s->height, 3, path, &error);
    const bool ok = buffer && saga_picture_read(path, s->width, s->height,
                                                buffer, &error);
    if (ok)
        saga_remap_rgb(remap, buffer, frame_to_fill(job, v, k));
    free(buffer);
    item_done(job, v * job->capture->n_frames + k, ok, &error);
}

/* Sets mask to 1 for pixels that are nearly white after undistortion and
 * scaling, so that no pixel at the mask's border counts. */
static void take_mask(uint8_t *mask, const uint8_t *rgb, size_t n)
{
    for (size_t i = 0; i < n; i++)
        mask[i] = rgb[3 * i] >= 250;
}

static void load_mask(saga_load_job *job, int v, int k, const saga_remap *remap)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_shot *const view = &job->capture->views[v];
    const int at = job->capture->first_frame + k;
    const size_t n = (size_t)view->width * (size_t)view->height;
    uint8_t *const mask = view->mask + n * (size_t)(view->single ? 0 : k);
    /* A separate mask file takes precedence over the picture's opacity. */
    const char *const path = s->masks && s->masks[at] ? s->masks[at]
                             : s->pictures            ? s->pictures[at]
                                                      : NULL;
    saga_error error = { "" };
    if (!path || (view->single && !saga_capture_has(job->capture, v, k))) {
        item_done(job, v * job->capture->n_frames + k, true, &error);
        return;
    }
    uint8_t *const buffer =
        saga_alloc((size_t)s->width * (size_t)s->height, 3, path, &error);
    uint8_t *const small = saga_alloc(n, 3, path, &error);
    const bool ok = buffer && small &&
                    (s->masks && path == s->masks[at]
                         ? saga_picture_read
                         : saga_picture_read_alpha)(path, s->width, s->height,
                                                    buffer, &error);
    /* The mask becomes black or white before it is remapped. Any other value
     * afterwards is a mixture at a border, which take_mask excludes. */
    for (size_t i = 0; ok && i < (size_t)s->width * (size_t)s->height; i++)
        memset(buffer + 3 * i, buffer[3 * i] >= 128 ? 255 : 0, 3);
    if (ok) {
        saga_remap_rgb(remap, buffer, small);
        take_mask(mask, small, n);
    }
    free(small);
    free(buffer);
    item_done(job, v * job->capture->n_frames + k, ok, &error);
}

static void load_depth(saga_load_job *job, int v, int k,
                       const saga_remap *remap)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_shot *const view = &job->capture->views[v];
    const char *const path = s->depths[job->capture->first_frame + k];
    saga_error error = { "" };
    float *const buffer =
        saga_alloc((size_t)s->width * (size_t)s->height, 4, path, &error);
    const bool ok = buffer && saga_exr_read_depth(path, s->width, s->height,
                                                  buffer, &error);
    if (ok)
        saga_remap_depth(remap, buffer, view->depth[k]);
    free(buffer);
    item_done(job, v * job->capture->n_frames + k, ok, &error);
}

typedef enum load_what { PICTURES, MASKS, DEPTHS } load_what;

/* Loads all still pictures, masks or depths of one view. */
static void load_view(saga_load_job *job, int v, load_what what)
{
    const saga_source *const s = &job->listing->sources[v];
    const int n = job->capture->n_frames;
    saga_remap remap = job->remaps[v];
    saga_error error = { "" };
    /* One table serves all frames of the view and is shared by the threads. */
    if (!saga_remap_build(&remap, &s->lens, job->listing->path, &error)) {
        item_done(job, v * n, false, &error);
        return;
    }
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->n_threads)
    for (int k = 0; k < n; k++) {
        if (item_skipped(job, v * n + k))
            continue;
        if (what == MASKS)
            load_mask(job, v, k, &remap);
        else if (what == PICTURES && !saga_capture_has(job->capture, v, k))
            item_done(job, v * n + k, true, &error);
        else if (what == PICTURES)
            load_picture(job, v, k, &remap);
        else if (job->capture->views[v].depth[k])
            load_depth(job, v, k, &remap);
    }
    saga_remap_free(&remap);
}

/* ---------------------------------------------------------- what is missing */

/* Fills missing pictures with the nearest existing picture of the same camera,
 * so that code that compares moments sees no motion. */
static void fill_missing(saga_load_job *job, int v)
{
    const saga_capture *const c = job->capture;
    for (int k = 0; k < saga_view_n_held(&c->views[v], c->n_frames); k++)
        if (!c->views[v].single && !saga_capture_has(c, v, k))
            memcpy(frame_to_fill(job, v, k),
                   frame_to_fill(job, v, saga_capture_near(c, v, k)),
                   saga_view_frame_nbytes(&c->views[v]));
}

/* Fills a pixel that does not count from the nearest frame in which it counts,
 * or with black if there is none. Time is linear in the number of frames. */
static void fill_masked(saga_load_job *job, int v)
{
    const saga_shot *const view = &job->capture->views[v];
    const int n = (int)((size_t)view->width * (size_t)view->height);
    const int n_frames = saga_view_n_held(view, job->capture->n_frames);
    const size_t size = saga_view_frame_nbytes(view);
    int i;
#pragma omp parallel for schedule(static) num_threads(job->n_threads)
    for (i = 0; i < n; i++) {
        const uint8_t *const counts = view->mask + i;
        uint8_t *const rgb = view->rgb + 3 * (size_t)i;
        for (int k = 0, last = -1, next = -1; k < n_frames; k++) {
            /* last <= k and next >= k are the nearest frames in which the pixel
             * counts, or -1 and n_frames if there are none. */
            if (next < k)
                for (next = k; next < n_frames &&
                               !counts[(size_t)n * (size_t)next];)
                    next++;
            if (next == k)
                last = k;
            const int from = last >= 0 && (next == n_frames ||
                                           k - last <= next - k)
                                 ? last : next;
            /* Only frames in which the pixel does not count are written, so
             * that copies always come from filmed pixels. */
            if (from == n_frames)
                memset(rgb + size * (size_t)k, 0, 3);
            else if (from != k)
                memcpy(rgb + size * (size_t)k, rgb + size * (size_t)from, 3);
        }
    }
}

/* ----------------------------------------------------------------- together */

bool saga_load_pictures(saga_load_job *job)
{
    const int n_views = job->listing->n_sources;
    const bool videos = job->listing->sources[0].video != NULL;
    job->n_items = videos ? n_views : n_views * job->capture->n_frames;
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->n_threads)
    /* Threads share out the cameras if these are videos. If they are stills,
     * the threads share out the pictures of one camera after the other. */
    for (int v = 0; v < (videos ? n_views : 0); v++)
        if (!item_skipped(job, v))
            load_video(job, v);
    for (int v = 0; !videos && v < n_views; v++)
        load_view(job, v, PICTURES);
    if (job->first_failed != INT32_MAX)
        return false;
    /* Missing pictures are filled before masked pixels: without a mask they
     * count everywhere, and fill_masked may copy from them. */
    for (int v = 0; v < n_views; v++)
        fill_missing(job, v);
    /* Masks come next, then depth; progress begins at 0 for each. */
    job->n_done = 0;
    job->n_items = n_views * job->capture->n_frames;
    for (int v = 0; v < n_views; v++)
        if (job->capture->views[v].mask)
            load_view(job, v, MASKS);
    if (job->first_failed != INT32_MAX)
        return false;
    for (int v = 0; v < n_views; v++)
        if (job->capture->views[v].mask)
            fill_masked(job, v);
    job->n_done = 0;
    for (int v = 0; v < n_views; v++)
        if (job->capture->views[v].depth)
            load_view(job, v, DEPTHS);
    return job->first_failed == INT32_MAX;
}
