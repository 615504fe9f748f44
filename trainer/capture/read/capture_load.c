/* SPDX-License-Identifier: MIT */
#include "capture_load.h"

#include "alloc.h"
#include "check.h"
#include "error.h"
#include "load_job.h"
#include "notes.h"
#include "subject.h"

#include <assert.h>
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
    return (saga_capture_options){ .scale = 1,
                                   .memory_nbytes = (uint64_t)4 << 30 };
}

/* ------------------------------------------------------------------ options */

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
    return !o->keyed || saga_subject_check_key(o->key, error);
}

static bool choose_range(saga_capture *capture, const saga_listing *listing,
                         const saga_capture_options *o, saga_error *error)
{
    const int end = o->end_frame ? o->end_frame : listing->n_frames;
    char remedy[64];
    (void)snprintf(remedy, sizeof remedy, "use a range within 0:%d",
                   listing->n_frames);
    if (end > listing->n_frames || o->first_frame >= end)
        return saga_fail(error, listing->path, remedy,
                         "--frames %d:%d is not "
                         "in the capture's %d frames",
                         o->first_frame, end, listing->n_frames);
    capture->first_frame = o->first_frame;
    capture->n_frames = end - o->first_frame;
    return true;
}

/* -------------------------------------------------------------------- views */

/* Marks the frames whose picture is missing. view->missing stays NULL if there
 * are none. */
static bool mark_missing(const saga_load_job *job, saga_source_view *view,
                         const saga_source *s)
{
    const int n = job->capture->n_frames;
    for (int k = 0; k < n; k++) {
        const int at = job->capture->first_frame + k;
        if (s->video ? saga_source_frame(s, at) >= 0 : s->pictures[at] != NULL)
            continue;
        if (!view->missing)
            view->missing = saga_calloc((size_t)n, sizeof *view->missing,
                                        s->name, job->error);
        if (!view->missing)
            return false;
        view->missing[k] = true;
        view->n_missing++;
    }
    /* A view without any picture stays in the rig; its pixels are set but not
     * used. */
    if (view->n_missing == n)
        memset(view->rgb, 0, saga_view_frame_nbytes(view));
    return true;
}

/* Returns count * size bytes for a view's pictures or masks: of the file if
 * there is one, which has exactly as many bytes as all views take. */
static uint8_t *take_pixels(saga_load_job *job, size_t count, size_t size,
                            const saga_source *s)
{
    const saga_scratch *const file = &job->capture->pixels;

    if (!file->at)
        return saga_alloc(count, size, s->name, job->error);
    job->n_taken += count * size;
    return file->at + job->n_taken - count * size;
}

static bool allocate_view(saga_load_job *job, saga_source_view *view,
                          const saga_source *s)
{
    const size_t n_frames = (size_t)job->capture->n_frames;
    const size_t px = (size_t)view->width * (size_t)view->height;
    const size_t n_held = (size_t)saga_view_n_held(view, (int)n_frames);
    view->rgb = take_pixels(job, n_held, px * 3, s);
    if (!view->rgb)
        return false;
    if (saga_load_has_masks(job, s)) {
        view->mask = take_pixels(job, n_held, px, s);
        if (!view->mask)
            return false;
        memset(view->mask, 1, px * n_held); /* pixels of frames without a mask
                                             * count */
    }
    bool any = false;
    for (size_t k = 0; s->depths && k < n_frames; k++)
        any |= s->depths[(size_t)job->capture->first_frame + k] != NULL;
    if (!any || !job->options->want_depth)
        return true;
    /* Only frames that have depth get memory for it; the others stay NULL. */
    view->depth = saga_calloc(n_frames, sizeof *view->depth, s->name,
                              job->error);
    for (size_t k = 0; view->depth && k < n_frames; k++) {
        if (!s->depths[(size_t)job->capture->first_frame + k])
            continue;
        view->depth[k] = saga_alloc(px, sizeof **view->depth, s->name,
                                    job->error);
        if (!view->depth[k])
            return false;
    }
    return view->depth != NULL;
}

/* Plans how the pictures of a video are kept: as filmed if they are in a file
 * and no pixel of them is changed. */
static bool keep_as_filmed(saga_load_job *job, saga_source_view *view,
                           const saga_source *s)
{
    const saga_video_info *const info = &s->info;
    if (!s->video || s->upright || !saga_lens_is_pinhole(&s->lens) ||
        job->options->scale > 1 || view->width != s->width ||
        view->height != s->height ||
        !saga_filmed_init(&view->filmed, info->depth, info->matrix,
                          info->full_range) ||
        view->mask || view->missing || !job->capture->pixels.at)
        return true;
    view->as_filmed = saga_calloc((size_t)job->capture->n_frames,
                                  sizeof *view->as_filmed, s->name, job->error);
    return view->as_filmed != NULL;
}

/* Allocates the working memory for pictures that are kept as filmed. */
static bool make_room(const saga_load_job *job)
{
    saga_capture *const c = job->capture;
    size_t most = 0;
    for (int v = 0; v < c->n_views; v++)
        if (c->views[v].as_filmed && saga_view_room(&c->views[v]) > most)
            most = saga_view_room(&c->views[v]);
    if (most > 0)
        c->room = saga_alloc(most, 1, job->listing->path, job->error);
    return most == 0 || c->room;
}

static bool make_view(saga_load_job *job, int v)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_remap *const m = &job->remaps[v];
    saga_source_view *const view = &job->capture->views[v];
    *view = (saga_source_view){ .width = m->width,
                                .height = m->height,
                                .fx = m->fx,
                                .fy = m->fy,
                                .cx = m->cx,
                                .cy = m->cy,
                                .near_depth = s->near_depth,
                                .far_depth = s->far_depth,
                                .held_out = s->held_out,
                                .late = s->late,
                                .single = saga_load_is_single(job, s),
                                .original_width = s->width,
                                .original_height = s->height,
                                .focal_scale = m->focal_scale,
                                .n_observations = s->n_observations,
                                .reprojection_median = s->reprojection_median,
                                .reprojection_p90 = s->reprojection_p90 };
    memcpy(view->name, s->name, sizeof view->name);
    memcpy(view->rotation, s->rotation, sizeof view->rotation);
    memcpy(view->translation, s->translation, sizeof view->translation);
    return allocate_view(job, view, s) && mark_missing(job, view, s) &&
           keep_as_filmed(job, view, s);
}

static void note_decisions(const saga_load_job *job)
{
    char *const notes = job->capture->notes;
    if (job->options->scale > 1)
        saga_note(notes, "scale: 1/%d, boxes of %d x %d pixels averaged",
                  job->options->scale, job->options->scale,
                  job->options->scale);
    /* Summarises how much undistortion changed focal lengths, and which camera
     * lacks most pictures. */
    double least = INFINITY, most = 0.0;
    int n_lenses = 0, n_missing = 0, n_lacking = 0, n_most = 0;
    const char *worst = "";
    for (int v = 0; v < job->capture->n_views; v++) {
        const saga_source_view *const view = &job->capture->views[v];
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
        saga_note(notes,
                  "lens: %d of %d cameras undistorted, focal lengths x "
                  "%.5f to %.5f",
                  n_lenses, job->capture->n_views, least, most);
    if (n_missing > 0 && !job->capture->moves)
        saga_note(notes,
                  "pictures: %d are missing and are skipped; they "
                  "belong to %d camera%s, most of them to %s (%d of %d)",
                  n_missing, n_lacking, n_lacking == 1 ? "" : "s", worst,
                  n_most, job->capture->n_frames);
}

static bool fill_capture(saga_load_job *job)
{
    saga_capture *const c = job->capture;
    const saga_listing *const listing = job->listing;
    c->views = saga_calloc((size_t)listing->n_sources, sizeof *c->views,
                           listing->path, job->error);
    if (!c->views || (saga_load_uses_scratch(job) &&
                      !saga_scratch_make(&c->pixels, job->options->scratch,
                                         c->picture_nbytes, job->error)))
        return false;
    c->n_views = listing->n_sources;
    for (int v = 0; v < c->n_views; v++)
        if (!make_view(job, v))
            return false;
    assert(job->n_taken == c->pixels.nbytes);
    if (!make_room(job))
        return false;
    note_decisions(job);
    /* Poses are checked before pictures are decoded, because that is much
     * cheaper. */
    saga_error *const told = job->options->wrong_poses;
    return ((told && saga_failed(told)) ||
            saga_check_overlap(c, listing->path, told ? told : job->error) ||
            told) &&
           saga_load_pictures(job);
}

/* ------------------------------------------------------------------ capture */

/* Limits for the focal length divided by the picture's width or height: an
 * angle of view of 175 degrees, and a telescope. */
#define MIN_FOCAL 0.02
#define MAX_FOCAL 1000.0

static bool check_focal(const saga_source *s, const char *path,
                        saga_error *error)
{
    const double x = s->lens.fx / s->width, y = s->lens.fy / s->height;
    /* saga_remap_plan refuses values that are not positive. */
    if (!(fmin(x, y) > 0.0) ||
        (fmin(x, y) >= MIN_FOCAL && fmax(x, y) <= MAX_FOCAL))
        return true;
    return saga_fail(error, path,
                     "give focal lengths in pixels of these "
                     "pictures",
                     "%s has focal lengths of %g and %g pixels "
                     "for pictures of %d x %d",
                     s->name, s->lens.fx, s->lens.fy, s->width, s->height);
}

/* Accepts the rates that a file can store in 1/1000 frame per second with at
 * least three digits. */
static bool check_fps(double fps, const char *path, saga_error *error)
{
    return (fps >= 0.1 && fps <= 1e5) ||
           saga_fail(error, path,
                     "give \"fps\", frames per second, or times "
                     "in seconds",
                     "its frame rate is %g, not 0.1 to 100000", fps);
}

/* Returns a file that a source has, or the capture's path, for messages. */
static const char *source_file(const saga_listing *l, const saga_source *s)
{
    for (int k = 0; !s->video && k < l->n_frames; k++)
        if (s->pictures[k])
            return s->pictures[k];
    return s->video ? s->video : l->path;
}

static bool plan_remaps(saga_load_job *job)
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
    /* Late cameras come first, because shifting them leaves fewer frames to
     * choose from. */
    if (!saga_listing_late(listing, options->late, error))
        return false;
    capture->poses = listing->poses;
    capture->format = listing->format;
    capture->moves = listing->moves;
    capture->scale = options->scale;
    /* The rate in the capture overrides the option; for metres, below, the
     * option overrides the capture. */
    capture->fps = listing->fps > 0.0   ? listing->fps
                   : options->fps > 0.0 ? options->fps
                                        : 30.0;
    capture->metres = options->metres > 0.0 ? options->metres : listing->metres;
    return check_fps(capture->fps, listing->path, error) &&
           choose_range(capture, listing, options, error);
}

/* Counts the training views and their pixels at the wanted scale. */
static void count_learned(saga_capture *capture, const saga_load_job *job)
{
    const double scale = job->options->scale;
    for (int v = 0; v < job->listing->n_sources; v++) {
        const saga_remap *const m = &job->remaps[v];
        const double px = floor(m->full_width / scale) *
                          floor(m->full_height / scale);
        if (job->listing->sources[v].held_out)
            continue;
        capture->n_learned++;
        capture->learned_pixels += px;
        capture->largest_pixels = fmax(capture->largest_pixels, px);
    }
}

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

/* Selects the wanted frames, and loads the pictures if `pictures` is set. */
static bool carry_out(saga_capture *capture, saga_listing *listing,
                      const saga_capture_options *options, bool pictures,
                      saga_error *error)
{
    saga_load_job job = { .options = options,
                          .listing = listing,
                          .capture = capture,
                          .error = error,
                          .first_failed = INT32_MAX,
                          .n_threads = options->n_threads > 0
                                           ? options->n_threads
                                           : omp_get_max_threads() };
    if (!choose_frames(capture, listing, options, error))
        return false;
    job.remaps = saga_calloc((size_t)listing->n_sources, sizeof *job.remaps,
                             listing->path, error);
    if (!job.remaps)
        return false;
    bool ok = plan_remaps(&job);
    if (ok) {
        capture->picture_nbytes = saga_load_picture_nbytes(&job);
        count_learned(capture, &job);
    }
    /* Looking at a capture does not check the budget, because it reports how
     * many frames fit. */
    if (ok && pictures) {
        take_points(capture, listing);
        ok = saga_load_check_budget(&job) && fill_capture(&job);
    }
    free(job.remaps);
    return ok;
}

/* Lists a capture and sets *capture; loads the pictures if `pictures` is
 * set. */
static bool list_and_carry_out(saga_capture *capture, const char *path,
                               const saga_capture_options *options,
                               bool pictures, saga_error *error)
{
    saga_listing listing = { .path = path };
    *capture = (saga_capture){ 0 };
    *error = (saga_error){ "" };
    const bool ok = check_options(options, path, error) &&
                    saga_listing_make(&listing, path, options, error) &&
                    saga_check_hands(&listing, options->wrong_poses, error) &&
                    carry_out(capture, &listing, options, pictures, error);
    saga_listing_free(&listing);
    return ok;
}

bool saga_capture_look(saga_capture *capture, const char *path,
                       const saga_capture_options *options, saga_error *error)
{
    return list_and_carry_out(capture, path, options, false, error);
}

bool saga_capture_load(saga_capture *capture, const char *path,
                       const saga_capture_options *options, saga_error *error)
{
    if (list_and_carry_out(capture, path, options, true, error))
        return true;
    saga_capture_free(capture);
    return false;
}
