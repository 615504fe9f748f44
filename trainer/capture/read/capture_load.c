/* SPDX-License-Identifier: MIT */
#include "capture_load.h"

#include "alloc.h"
#include "check.h"
#include "error.h"
#include "file.h"
#include "load.h"
#include "notes.h"
#include "picture.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#ifdef _OPENMP
#include <omp.h>
#else
#define omp_get_max_threads() 1
#endif

saga_capture_options saga_capture_defaults(void)
{
    return (saga_capture_options){.scale = 1,
                                  .memory_nbytes = (uint64_t)4 << 30};
}

/* ----------------------------------------------------------------- options */

static bool check_options(const saga_capture_options *o, const char *path,
                          saga_error *error)
{
    if (o->scale < 1 || o->scale > SAGA_MAX_SCALE)
        return saga_fail(error, path, "use --scale 1/N with N from 1 to 64",
                         "--scale 1/%d is out of range", o->scale);
    if (o->first_frame < 0 || o->end_frame < 0 ||
        (o->end_frame > 0 && o->end_frame <= o->first_frame))
        return saga_fail(error, path, "use --frames A:B with 0 <= A < B",
                         "--frames %d:%d is empty", o->first_frame,
                         o->end_frame);
    return true;
}

static bool choose_range(saga_capture *capture, const saga_listing *listing,
                         const saga_capture_options *o,
                         saga_error *error)
{
    const int end = o->end_frame ? o->end_frame : listing->n_frames;
    char remedy[64];
    (void)snprintf(remedy, sizeof remedy, "use a range within 0:%d",
                   listing->n_frames);
    if (end > listing->n_frames || o->first_frame >= end)
        return saga_fail(error, listing->path, remedy, "--frames %d:%d is not "
                         "in the capture's %d frames", o->first_frame, end,
                         listing->n_frames);
    capture->first_frame = o->first_frame;
    capture->n_frames = end - o->first_frame;
    return true;
}

/* ---------------------------------------------------------------- forecast */

typedef struct load_job {
    const saga_capture_options *options;
    const saga_listing *listing;
    saga_capture *capture;
    saga_remap *remaps;       /* (n_views), planned, without tables */
    int n_threads;
    saga_error *error;
    /* Guarded by "omp critical(saga_load)". */
    int first_failed;         /* lowest item that failed; INT32_MAX none,
                               * -1 cancelled */
    int n_done, n_items;
} load_job;

static bool has_masks(const load_job *job, const saga_source *s)
{
    bool any = job->options->alpha_masks && s->pictures;
    for (int k = 0; s->masks && !any && k < job->capture->n_frames; k++)
        any = s->masks[job->capture->first_frame + k] != NULL;
    return any;
}

/* Tells whether a source has at most one of several pictures wanted. */
static bool is_single(const load_job *job, const saga_source *s)
{
    int n = 0;
    for (int k = 0; !s->video && k < job->capture->n_frames; k++)
        n += s->pictures[job->capture->first_frame + k] != NULL;
    return !s->video && n < 2 && job->capture->n_frames > 1;
}

static double picture_nbytes(const load_job *job, int v, double scale)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_remap *const m = &job->remaps[v];
    const double px =
        floor(m->full_width / scale) * floor(m->full_height / scale);
    /* 3 bytes of colour a pixel, and one of the mask. */
    double n = (has_masks(job, s) ? 4.0 : 3.0) * px *
               (is_single(job, s) ? 1 : job->capture->n_frames);
    /* Depth is of 4 bytes, and held for each frame that has it, single view or
     * not. */
    for (int k = 0; s->depths && job->options->want_depth &&
                    k < job->capture->n_frames; k++)
        if (s->depths[job->capture->first_frame + k])
            n += 4.0 * px;
    return n;
}

/* A thread has one source picture, its table and one depth picture. */
static double scratch_nbytes(const load_job *job)
{
    double most = 0.0;
    for (int v = 0; v < job->listing->n_sources; v++) {
        const saga_source *const s = &job->listing->sources[v];
        /* 3 bytes of colour and 4 of depth for each pixel of the file. */
        most = fmax(most, 7.0 * s->width * s->height +
                              (double)saga_remap_nbytes(&job->remaps[v],
                                                        &s->lens));
    }
    return most * job->n_threads;
}

static double pictures_nbytes(const load_job *job, double scale)
{
    double n = 0.0;
    for (int v = 0; v < job->listing->n_sources; v++)
        n += picture_nbytes(job, v, scale);
    return n;
}

static double forecast(const load_job *job, double scale)
{
    return scratch_nbytes(job) + pictures_nbytes(job, scale);
}

static void say_remedy(const load_job *job, double need, char *text, size_t n)
{
    const double budget = (double)job->options->memory_nbytes;
    const double frames = need - scratch_nbytes(job);
    int scale = job->options->scale;
    /* The first smaller scale at which everything fits. */
    while (scale < SAGA_MAX_SCALE && forecast(job, scale) > budget)
        scale++;
    /* The number of frames that fit at the wanted scale, beside what the
     * threads need however few frames there are. */
    const int fit = (int)floor((budget - scratch_nbytes(job)) / frames *
                               job->capture->n_frames);
    size_t used = (size_t)snprintf(text, n, "use ");
    if (forecast(job, scale) <= budget)
        used += (size_t)snprintf(text + used, n - used, "--scale 1/%d, ",
                                 scale);
    if (fit > 0)
        used += (size_t)snprintf(text + used, n - used, "--frames %d:%d, ",
                                 job->capture->first_frame,
                                 job->capture->first_frame + fit);
    (void)snprintf(text + used, n - used, "%s--memory %.0f (GiB)",
                   used > strlen("use ") ? "or " : "",
                   ceil(need / 1073741824.0));
}

static bool check_budget(const load_job *job)
{
    const double need = forecast(job, job->options->scale);
    if (need <= (double)job->options->memory_nbytes && need < 9e15)
        return true;
    const saga_source *const s = &job->listing->sources[0];
    char remedy[200];
    say_remedy(job, need, remedy, sizeof remedy);
    return saga_fail(job->error, job->listing->path, remedy, "%d cameras x %d "
                     "frames of %d x %d pixels at 1/%d need %.1f MiB, the "
                     "budget is %.1f MiB", job->listing->n_sources,
                     job->capture->n_frames, s->width, s->height,
                     job->options->scale, need / 1048576.0,
                     (double)job->options->memory_nbytes / 1048576.0);
}

/* ---------------------------------------------------------------- decoding */

/* Counts an item that is done. The error of the lowest item wins: items start
 * in order, so it is the same one for any number of threads. */
static void item_done(load_job *job, int item, bool ok,
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

/* Only what comes after a failure is given up: an earlier item may yet turn
 * out to be the first that fails. */
static bool item_skipped(load_job *job, int item)
{
    bool skip;
#pragma omp critical(saga_load)
    skip = job->first_failed < item;
    return skip;
}

static uint8_t *frame_to_fill(const load_job *job, int v, int k)
{
    const saga_shot *const view = &job->capture->views[v];
    return view->rgb + saga_view_frame_nbytes(view) *
                           (size_t)(view->single ? 0 : k);
}

static bool read_video(load_job *job, int v, const saga_remap *remap,
                       uint8_t *buffer, saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    const int first = s->skip + job->capture->first_frame;
    const int end = first + job->capture->n_frames;
    saga_video video;
    if (!saga_video_open(&video, s->video, &s->info, end, error))
        return false;
    bool ok = true;
    /* Videos are read from their start: frames before the first wanted one are
     * decoded and dropped. */
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

static void load_video(load_job *job, int v)
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

static void load_picture(load_job *job, int v, int k, const saga_remap *remap)
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

/* Lets pixels count where the mask is nearly white after lens and scale:
 * nothing of a mask's border is in them. */
static void take_mask(uint8_t *mask, const uint8_t *rgb, size_t n)
{
    for (size_t i = 0; i < n; i++)
        mask[i] = rgb[3 * i] >= 250;
}

static void load_mask(load_job *job, int v, int k, const saga_remap *remap)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_shot *const view = &job->capture->views[v];
    const int at = job->capture->first_frame + k;
    const size_t n = (size_t)view->width * (size_t)view->height;
    uint8_t *const mask = view->mask + n * (size_t)(view->single ? 0 : k);
    /* A mask of its own comes before the picture's opacity. */
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
    /* Black or white before lens and scale: any other value in the result is a
     * mixture at a border, of which take_mask wants nearly nothing. */
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

static void load_depth(load_job *job, int v, int k, const saga_remap *remap)
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
static void load_view(load_job *job, int v, load_what what)
{
    const saga_source *const s = &job->listing->sources[v];
    const int n = job->capture->n_frames;
    saga_remap remap = job->remaps[v];
    saga_error error = { "" };
    /* One table serves all frames of the view, and its threads share it. */
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

/* A missing picture looks like the nearest of its camera that is there, so that
 * what compares moments sees no motion in it. */
static void fill_missing(load_job *job, int v)
{
    const saga_capture *const c = job->capture;
    for (int k = 0; k < saga_view_n_held(&c->views[v], c->n_frames); k++)
        if (!c->views[v].single && !saga_capture_has(c, v, k))
            memcpy(frame_to_fill(job, v, k),
                   frame_to_fill(job, v, saga_capture_near(c, v, k)),
                   saga_view_frame_nbytes(&c->views[v]));
}

/* A pixel that does not count looks as in the nearest frame in which it does;
 * black where there is none. The time of both passes is linear. */
static void fill_masked(load_job *job, int v)
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
            /* last and next are the frames nearest to k, up to it and from it
             * on, in which the pixel counts: -1 and n_frames where there is
             * none. */
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
             * what is copied is always a pixel that was filmed. */
            if (from == n_frames)
                memset(rgb + size * (size_t)k, 0, 3);
            else if (from != k)
                memcpy(rgb + size * (size_t)k, rgb + size * (size_t)from, 3);
        }
    }
}

static bool load_all(load_job *job)
{
    const int n_views = job->listing->n_sources;
    const bool videos = job->listing->sources[0].video != NULL;
    job->n_items = videos ? n_views : n_views * job->capture->n_frames;
#pragma omp parallel for schedule(dynamic, 1) num_threads(job->n_threads)
    /* Pictures. Threads share the cameras where these are videos, and the
     * pictures of one camera after the other where they are stills. */
    for (int v = 0; v < (videos ? n_views : 0); v++)
        if (!item_skipped(job, v))
            load_video(job, v);
    for (int v = 0; !videos && v < n_views; v++)
        load_view(job, v, PICTURES);
    if (job->first_failed != INT32_MAX)
        return false;
    /* Holes are filled before masks are: a missing picture without a mask
     * counts everywhere, and fill_masked may copy from it. */
    for (int v = 0; v < n_views; v++)
        fill_missing(job, v);
    /* Masks, then depth; progress runs from 0 again for each. */
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

/* ----------------------------------------------------------------- capture */

/* Marks the frames whose picture is missing; nothing where none is. */
static bool mark_missing(const load_job *job, saga_shot *view,
                         const saga_source *s)
{
    const int n = job->capture->n_frames;
    for (int k = 0; !s->video && k < n; k++) {
        if (s->pictures[job->capture->first_frame + k])
            continue;
        if (!view->missing)
            view->missing = saga_calloc((size_t)n, sizeof *view->missing,
                                        s->name, job->error);
        if (!view->missing)
            return false;
        view->missing[k] = true;
        view->n_missing++;
    }
    /* Nothing of it is looked at, but it stays in the rig. */
    if (view->n_missing == n)
        memset(view->rgb, 0, saga_view_frame_nbytes(view));
    return true;
}

static bool allocate_view(const load_job *job, saga_shot *view,
                          const saga_source *s)
{
    const size_t n_frames = (size_t)job->capture->n_frames;
    const size_t px = (size_t)view->width * (size_t)view->height;
    const size_t n_held = (size_t)saga_view_n_held(view, (int)n_frames);
    view->rgb = saga_alloc(px * 3, n_held, s->name, job->error);
    if (!view->rgb)
        return false;
    if (has_masks(job, s)) {
        view->mask = saga_alloc(px, n_held, s->name, job->error);
        if (!view->mask)
            return false;
        memset(view->mask, 1, px * n_held); /* what has none counts */
    }
    bool any = false;
    for (size_t k = 0; s->depths && k < n_frames; k++)
        any |= s->depths[(size_t)job->capture->first_frame + k] != NULL;
    if (!any || !job->options->want_depth)
        return true;
    /* The frames that have depth get memory for it, the others stay NULL. */
    view->depth =
        saga_calloc(n_frames, sizeof *view->depth, s->name, job->error);
    for (size_t k = 0; view->depth && k < n_frames; k++) {
        if (!s->depths[(size_t)job->capture->first_frame + k])
            continue;
        view->depth[k] =
            saga_alloc(px, sizeof **view->depth, s->name, job->error);
        if (!view->depth[k])
            return false;
    }
    return view->depth != NULL;
}

static bool make_view(const load_job *job, int v)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_remap *const m = &job->remaps[v];
    saga_shot *const view = &job->capture->views[v];
    *view = (saga_shot){
        .width = m->width, .height = m->height, .fx = m->fx, .fy = m->fy,
        .cx = m->cx, .cy = m->cy, .near_depth = s->near_depth,
        .far_depth = s->far_depth, .held_out = s->held_out, .late = s->late,
        .single = is_single(job, s), .original_width = s->width,
        .original_height = s->height, .focal_scale = m->focal_scale,
        .n_observations = s->n_observations,
        .reprojection_median = s->reprojection_median,
        .reprojection_p90 = s->reprojection_p90};
    memcpy(view->name, s->name, sizeof view->name);
    memcpy(view->rotation, s->rotation, sizeof view->rotation);
    memcpy(view->translation, s->translation, sizeof view->translation);
    return allocate_view(job, view, s) && mark_missing(job, view, s);
}

static void note_decisions(const load_job *job)
{
    char *const notes = job->capture->notes;
    if (job->options->scale > 1)
        saga_note(notes, "scale: 1/%d, boxes of %d x %d pixels averaged",
                  job->options->scale, job->options->scale,
                  job->options->scale);
    double least = INFINITY, most = 0.0;
    int n_lenses = 0, n_missing = 0, n_lacking = 0, n_most = 0;
    const char *worst = "";
    for (int v = 0; v < job->capture->n_views; v++) {
        const saga_shot *const view = &job->capture->views[v];
        if (!saga_lens_is_pinhole(&job->listing->sources[v].lens)) {
            least = fmin(least, view->focal_scale);
            most = fmax(most, view->focal_scale);
            n_lenses++;
        }
        n_missing += view->n_missing;
        n_lacking += view->n_missing > 0;
        if (view->n_missing > n_most) {
            n_most = view->n_missing;
            worst = view->name;
        }
    }
    if (n_lenses > 0)
        saga_note(notes, "lens: %d of %d cameras undistorted, focal lengths x "
                  "%.5f to %.5f", n_lenses, job->capture->n_views, least, most);
    if (n_missing > 0 && !job->capture->moves)
        saga_note(notes, "pictures: %d are missing, and neither learned nor "
                  "judged: of %d cameras, most of %s (%d of %d)", n_missing,
                  n_lacking, worst, n_most, job->capture->n_frames);
}

static bool fill_capture(load_job *job)
{
    saga_capture *const c = job->capture;
    const saga_listing *const listing = job->listing;
    c->views = saga_calloc((size_t)listing->n_sources, sizeof *c->views,
                           listing->path, job->error);
    if (!c->views)
        return false;
    c->n_views = listing->n_sources;
    for (int v = 0; v < c->n_views; v++)
        if (!make_view(job, v))
            return false;
    note_decisions(job);
    /* Poses are cheap to check, pictures are not to decode. */
    return saga_check_overlap(c, listing->path, job->error) && load_all(job);
}

/* Focal lengths in sides of the picture: of an angle of 175 degrees, and of a
 * telescope. */
#define MIN_FOCAL 0.02
#define MAX_FOCAL 1000.0

static bool check_focal(const saga_source *s, const char *path,
                        saga_error *error)
{
    const double x = s->lens.fx / s->width, y = s->lens.fy / s->height;
    /* saga_remap_plan refuses those that are not positive. */
    if (!(fmin(x, y) > 0.0) ||
        (fmin(x, y) >= MIN_FOCAL && fmax(x, y) <= MAX_FOCAL))
        return true;
    return saga_fail(error, path, "give focal lengths in pixels of these "
                     "pictures", "%s has focal lengths of %g and %g pixels "
                     "for pictures of %d x %d", s->name, s->lens.fx,
                     s->lens.fy, s->width, s->height);
}

/* Takes the rates of which a file can say three digits, in 1/1000 of a frame
 * per second. */
static bool check_fps(double fps, const char *path, saga_error *error)
{
    return (fps >= 0.1 && fps <= 1e5) ||
           saga_fail(error, path, "give \"fps\", frames per second, or times "
                     "in seconds", "its frame rate is %g, not 0.1 to 100000",
                     fps);
}

/* Returns a file that a source has, or where it should be, for messages. */
static const char *source_file(const saga_listing *l, const saga_source *s)
{
    for (int k = 0; !s->video && k < l->n_frames; k++)
        if (s->pictures[k])
            return s->pictures[k];
    return s->video ? s->video : l->path;
}

static bool plan_remaps(load_job *job)
{
    for (int v = 0; v < job->listing->n_sources; v++) {
        const saga_source *const s = &job->listing->sources[v];
        if (!check_focal(s, job->listing->path, job->error) ||
            !saga_remap_plan(&job->remaps[v], &s->lens, s->width, s->height,
                             job->options->scale, source_file(job->listing, s),
                             job->error))
            return false;
    }
    return true;
}

static bool choose_frames(saga_capture *capture, saga_listing *listing,
                          const saga_capture_options *options,
                          saga_error *error)
{
    /* Late cameras come first: shifting them leaves fewer frames to choose
     * from. */
    if (!saga_listing_late(listing, options->late, error))
        return false;
    capture->format = listing->format;
    capture->moves = listing->moves;
    capture->scale = options->scale;
    /* The rate that a capture tells wins over the option; of metres, below, it
     * is the other way round. */
    capture->fps = listing->fps > 0.0      ? listing->fps
                   : options->fps > 0.0 ? options->fps
                                        : 30.0;
    capture->metres = options->metres > 0.0 ? options->metres
                                            : listing->metres;
    return check_fps(capture->fps, listing->path, error) &&
           choose_range(capture, listing, options, error);
}

/* Returns how many frames' pictures take half the budget: what a thread needs
 * besides does not count, so that it is the same for any number of them. */
static int frames_that_fit(const load_job *job)
{
    const double need = pictures_nbytes(job, job->options->scale);
    const double part = (double)job->options->memory_nbytes / 2.0 / need;
    return (int)fmin(floor(job->capture->n_frames * part), SAGA_MAX_FRAMES);
}

/* Counts what is learned from, at the scale that is wanted. */
static void count_learned(saga_capture *capture, const load_job *job)
{
    const double scale = job->options->scale;
    for (int v = 0; v < job->listing->n_sources; v++) {
        const saga_remap *const m = &job->remaps[v];
        const double px =
            floor(m->full_width / scale) * floor(m->full_height / scale);
        if (job->listing->sources[v].held_out)
            continue;
        capture->n_learned++;
        capture->learned_pixels += px;
        capture->largest_pixels = fmax(capture->largest_pixels, px);
    }
}

/* Moves the points and the notes to the capture. */
static void take_points(saga_capture *capture, saga_listing *listing)
{
    capture->points = listing->points;
    capture->n_points = listing->n_points;
    listing->points = NULL;
    memcpy(capture->notes, listing->notes, sizeof capture->notes);
    if (listing->fps <= 0.0 && listing->n_frames > 1)
        saga_note(capture->notes, "time: frame rate unknown, %g assumed",
                  capture->fps);
}

/* Takes the frames that are wanted, and with `pictures` loads them. */
static bool carry_out(saga_capture *capture, saga_listing *listing,
                      const saga_capture_options *options, bool pictures,
                      saga_error *error)
{
    load_job job = {.options = options, .listing = listing, .capture = capture,
                    .error = error, .first_failed = INT32_MAX,
                    .n_threads = options->n_threads > 0
                                     ? options->n_threads
                                     : omp_get_max_threads()};
    if (!choose_frames(capture, listing, options, error))
        return false;
    job.remaps = saga_calloc((size_t)listing->n_sources, sizeof *job.remaps,
                             listing->path, error);
    if (!job.remaps)
        return false;
    bool ok = plan_remaps(&job);
    if (ok) {
        capture->n_fitting = frames_that_fit(&job);
        count_learned(capture, &job);
    }
    /* Looking at a capture does not check the budget: it tells how many frames
     * fit. */
    if (ok && pictures) {
        take_points(capture, listing);
        ok = check_budget(&job) && fill_capture(&job);
    }
    free(job.remaps);
    return ok;
}

bool saga_capture_look(saga_capture *capture, const char *path,
                       const saga_capture_options *options,
                       saga_error *error)
{
    saga_listing listing = {.path = path};
    *capture = (saga_capture){0};
    *error = (saga_error){ "" };
    const bool ok = check_options(options, path, error) &&
                    saga_listing_make(&listing, path, options, error) &&
                    carry_out(capture, &listing, options, false, error);
    saga_listing_free(&listing);
    return ok;
}

bool saga_capture_load(saga_capture *capture, const char *path,
                       const saga_capture_options *options,
                       saga_error *error)
{
    saga_listing listing = {.path = path};
    *capture = (saga_capture){0};
    *error = (saga_error){ "" };
    const bool ok = check_options(options, path, error) &&
                    saga_listing_make(&listing, path, options, error) &&
                    carry_out(capture, &listing, options, true, error);
    saga_listing_free(&listing);
    if (!ok)
        saga_capture_free(capture);
    return ok;
}
