/* SPDX-License-Identifier: MIT
 *
 * Decodes pictures, masks and depth with several threads, undistorts them, and
 * scales them into the views of a capture.
 */
#include "load_job.h"

#include "alloc.h"
#include "error.h"
#include "picture.h"
#include "subject.h"

#include <stdlib.h>
#include <string.h>

/* ----------------------------------------------------------------- progress */

/* Keeps the error of a failed item. If several fail, that of the lowest one is
 * kept. Items start in order, so that is the same error for any number of
 * threads. */
static void item_failed(saga_load_job *job, int item, const saga_error *error)
{
#pragma omp critical(saga_load)
    if (item < job->first_failed) {
        job->first_failed = item;
        *job->error = *error;
    }
}

/* Counts a picture. */
static void picture_done(saga_load_job *job)
{
    const saga_capture_options *const o = job->options;
#pragma omp critical(saga_load)
    {
        job->n_done++;
        if (job->first_failed == INT32_MAX && o->progress &&
            !o->progress(o->progress_user,
                         (double)job->n_done / job->n_pictures, "loading")) {
            job->first_failed = -1;
            saga_fail(job->error, job->listing->path, NULL, "cancelled");
        }
    }
}

/* Ends an item that is a picture. */
static void item_done(saga_load_job *job, int item, bool ok,
                      const saga_error *error)
{
    if (!ok)
        item_failed(job, item, error);
    picture_done(job);
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
    const saga_source_view *const view = &job->capture->views[v];
    return view->rgb +
           saga_view_frame_nbytes(view) * (size_t)(view->single ? 0 : k);
}

/* Fills a view's mask from a picture of its source. Of a subject this is its
 * opacity. Otherwise the picture is black or white, and any other value after
 * undistortion and scaling is a mixture at a border; a pixel counts if it is
 * nearly white, so that no pixel at the border does. */
static bool fill_mask(const saga_load_job *job, int v, int k,
                      const saga_remap *remap, const uint8_t *rgb,
                      saga_error *error)
{
    const saga_source_view *const view = &job->capture->views[v];
    const size_t n = (size_t)view->width * (size_t)view->height;
    uint8_t *const mask = view->mask + n * (size_t)(view->single ? 0 : k);
    uint8_t *const small = saga_alloc(n, 3, view->name, error);
    if (!small)
        return false;
    saga_remap_rgb(remap, rgb, small);
    for (size_t i = 0; i < n; i++)
        mask[i] = job->options->subject ? small[3 * i] : small[3 * i] >= 250;
    free(small);
    return true;
}

/* Returns the mask's file of a picture; NULL if it has none. */
static const char *mask_file(const saga_load_job *job, int v, int k)
{
    const saga_source *const s = &job->listing->sources[v];
    return s->masks ? s->masks[job->capture->first_frame + k] : NULL;
}

/* Splits n pixels of RGBA: the opacity moves to `mask`, as grey, and the colour
 * up to where it is RGB. */
static void split_opacity(uint8_t *pixels, size_t n, uint8_t *mask)
{
    for (size_t i = 0; i < n; i++) {
        memset(mask + 3 * i, pixels[4 * i + 3], 3);
        memmove(pixels + 3 * i, pixels + 4 * i, 3);
    }
}

/* Makes n grey pixels white, if they are `white` or more, or black. */
static void split_grey(uint8_t *grey, size_t n, int white)
{
    for (size_t i = 0; i < n; i++)
        memset(grey + 3 * i, grey[3 * i] >= white ? 255 : 0, 3);
}

/* A picture as it is read, and its mask if it has one here: that of its
 * opacity, or that of a subject. For a video in 4:2:0 there is also its picture
 * as filmed. */
typedef struct canvas {
    bool opacity;           /* the pixels are RGBA, not RGB */
    uint8_t *pixels, *mask; /* no mask: NULL */
    uint8_t *filmed, *room; /* room: to convert it; not 4:2:0: NULL */
    saga_filmed how;
} canvas;

static bool make_canvas(canvas *c, const saga_load_job *job,
                        const saga_source *s, const char *path,
                        saga_error *error)
{
    const bool opacity = saga_load_has_opacity(job, s);
    const bool mask = opacity || job->options->subject;
    const size_t n = (size_t)s->width * (size_t)s->height;
    *c = (canvas){ .opacity = opacity,
                   .pixels = saga_alloc(n, opacity ? 4 : 3, path, error) };
    if (mask)
        c->mask = saga_alloc(n, 3, path, error);
    return c->pixels && (c->mask || !mask);
}

/* Adds what a video in 4:2:0 needs, whose frames are read as they are
 * stored. */
static bool add_filmed(canvas *c, const saga_source *s, saga_error *error)
{
    const saga_video_info *const info = &s->info;
    if (s->upright ||
        !saga_filmed_init(&c->how, info->depth, info->matrix, info->full_range))
        return true;
    c->filmed = saga_alloc(
        saga_filmed_nbytes(c->how.depth, s->width, s->height), 1, s->video,
        error);
    c->room = saga_alloc(saga_filmed_room(s->width), 1, s->video, error);
    return c->filmed && c->room;
}

static void free_canvas(canvas *c)
{
    free(c->pixels);
    free(c->mask);
    free(c->filmed);
    free(c->room);
}

/* Makes n pixels of a mask grey, with the largest of their channels. If the
 * mask has only two values, whatever they are, the larger one is white, and so
 * is a single value except 0. Otherwise white begins in the middle of the
 * range, except for a subject, whose opacity all values are. */
static void make_grey(uint8_t *rgb, size_t n, bool subject)
{
    int least = 255, most = 0;
    bool two = true;
    for (size_t i = 0; i < n; i++) {
        uint8_t *const p = rgb + 3 * i;
        p[0] = p[1] > p[0] ? p[1] : p[0];
        p[0] = p[2] > p[0] ? p[2] : p[0];
        p[1] = p[2] = p[0];
        least = p[0] < least ? p[0] : least;
        most = p[0] > most ? p[0] : most;
    }
    for (size_t i = 0; two && i < n; i++)
        two = rgb[3 * i] == least || rgb[3 * i] == most;
    if (two)
        split_grey(rgb, n, most > 0 ? most : 1);
    else if (!subject)
        split_grey(rgb, n, 128);
}

/* Reads the mask's file of a picture, grey, (height, width, 3). */
static bool read_grey(const saga_load_job *job, int v, int k, uint8_t *grey,
                      saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_picture_wish wish = { .width = s->width,
                                     .height = s->height,
                                     .upright = s->upright,
                                     .form = SAGA_PICTURE_MASK };
    if (!saga_picture_read(mask_file(job, v, k), &wish, grey, error))
        return false;
    make_grey(grey, (size_t)s->width * (size_t)s->height,
              job->options->subject);
    return true;
}

/* Returns the file of a picture, for messages. */
static const char *source_file(const saga_load_job *job, int v, int k)
{
    const saga_source *const s = &job->listing->sources[v];
    return s->pictures ? s->pictures[job->capture->first_frame + k] : s->video;
}

/* Cuts the subject out of a picture by the key, by its mask, or by the opacity
 * that is in the mask already. */
static bool cut_out(const saga_load_job *job, int v, int k, const canvas *c,
                    saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    const size_t n = (size_t)s->width * (size_t)s->height;
    if (job->options->keyed) {
        saga_subject_key(c->pixels, c->mask, n, job->options->key);
        return true;
    }
    if (!mask_file(job, v, k) &&
        (!c->opacity || saga_subject_is_all(c->mask, 3 * n, 255)))
        return saga_fail(error, source_file(job, v, k),
                         "give it a mask, as `saga help check` says, or "
                         "opacity, or --key, or leave --subject out",
                         "nothing tells the subject from the rest in a picture "
                         "of camera %s",
                         s->name);
    if (mask_file(job, v, k) && !read_grey(job, v, k, c->mask, error))
        return false;
    saga_subject_cut(c->pixels, c->mask, n);
    return true;
}

/* Tells whether a view's digest is of its pictures as filmed. A subject is cut
 * out by masks or a key, which change pixels. */
static bool is_of_film(const saga_load_job *job, const saga_source_view *view)
{
    return view->filmed.depth && !job->options->subject;
}

/* Fills a view's picture, and its mask if that is here; a mask of its own takes
 * precedence over opacity. */
static bool fill_picture(const saga_load_job *job, int v, int k,
                         const saga_remap *remap, const canvas *from,
                         saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    saga_source_view *const view = &job->capture->views[v];
    const bool subject = job->options->subject;
    const bool same = !remap->taps && remap->scale == 1;
    const size_t n = (size_t)s->width * (size_t)s->height;
    uint8_t *const to = frame_to_fill(job, v, k);
    if (from->opacity)
        split_opacity(from->pixels, n, from->mask);
    if (from->opacity && !subject)
        split_grey(from->mask, n, 128);
    if (subject && !cut_out(job, v, k, from, error))
        return false;
    if (same && job->capture->pixels.at)
        saga_scratch_copy(&job->capture->pixels, to, from->pixels, 3 * n);
    else
        saga_remap_rgb(remap, from->pixels, to);
    if (!is_of_film(job, view))
        saga_view_add_digest(view, k, same ? from->pixels : to,
                             saga_view_frame_nbytes(view));
    return !from->mask || (mask_file(job, v, k) && !subject) ||
           fill_mask(job, v, k, remap, from->mask, error);
}

/* Returns the number of the video's frames up to the last that is used. */
static int n_decoded(const saga_load_job *job, const saga_source *s)
{
    const int first = job->capture->first_frame;
    for (int k = job->capture->n_frames; k-- > 0;)
        if (saga_source_frame(s, first + k) >= 0)
            return saga_source_frame(s, first + k) + 1;
    return 0;
}

/* Takes the frame that was read from a video as picture k of view v. */
static bool take_frame(const saga_load_job *job, int v, int k,
                       const saga_remap *remap, const canvas *at,
                       saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    saga_source_view *const view = &job->capture->views[v];
    const int size[2] = { s->width, s->height };
    const size_t n = saga_filmed_nbytes(at->how.depth, size[0], size[1]);
    if (is_of_film(job, view))
        saga_view_add_digest(view, k, at->filmed, n);
    if (view->as_filmed) {
        saga_scratch_copy(&job->capture->pixels, frame_to_fill(job, v, k),
                          at->filmed, n);
        atomic_store(view->as_filmed + k, 1);
        return true;
    }
    if (at->filmed)
        saga_filmed_develop(at->pixels, at->filmed, &at->how, size, at->room);
    return fill_picture(job, v, k, remap, at, error);
}

static bool read_video(saga_load_job *job, int v, const saga_remap *remap,
                       const canvas *at, saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    const int first = job->capture->first_frame, n = job->capture->n_frames;
    const int end = n_decoded(job, s);
    saga_video_info info = s->info;
    saga_video video;
    info.width = s->width;
    info.height = s->height;
    info.upright = s->upright;
    info.opacity = at->opacity;
    info.depth = at->how.depth;
    if (end == 0)
        return true;
    if (!saga_video_open(&video, s->video, &info, end, error))
        return false;
    bool ok = true;
    /* Videos are decoded from their start; frames that belong to no wanted
     * moment are dropped. */
    for (int j = 0, k = 0; ok && j < end; j++) {
        while (k < n && saga_source_frame(s, first + k) < j)
            k++;
        ok = saga_video_next(&video, at->filmed ? at->filmed : at->pixels,
                             error);
        if (ok && k < n && saga_source_frame(s, first + k) == j) {
            ok = take_frame(job, v, k, remap, at, error);
            if (ok)
                picture_done(job);
        }
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
    canvas at = { .pixels = NULL };
    bool ok = make_canvas(&at, job, s, s->video, &error) &&
              add_filmed(&at, s, &error) &&
              saga_remap_build(&remap, &s->lens, s->video, &error);
    ok = ok && read_video(job, v, &remap, &at, &error);
    saga_remap_free(&remap);
    free_canvas(&at);
    if (!ok)
        item_failed(job, v, &error);
}

static bool read_picture(const saga_load_job *job, int v, int k,
                         const saga_remap *remap, saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    const char *const path = s->pictures[job->capture->first_frame + k];
    canvas at;
    bool ok = make_canvas(&at, job, s, path, error);
    const saga_picture_wish wish = { .width = s->width,
                                     .height = s->height,
                                     .upright = s->upright,
                                     .form = at.opacity ? SAGA_PICTURE_RGBA
                                                        : SAGA_PICTURE_RGB };
    ok = ok && saga_picture_read(path, &wish, at.pixels, error) &&
         fill_picture(job, v, k, remap, &at, error);
    free_canvas(&at);
    return ok;
}

static void load_picture(saga_load_job *job, int v, int k,
                         const saga_remap *remap)
{
    saga_error error = { "" };
    const bool ok = read_picture(job, v, k, remap, &error);
    item_done(job, v * job->capture->n_frames + k, ok, &error);
}

static bool read_mask(const saga_load_job *job, int v, int k,
                      const saga_remap *remap, saga_error *error)
{
    const saga_source *const s = &job->listing->sources[v];
    uint8_t *const buffer = saga_alloc((size_t)s->width * (size_t)s->height, 3,
                                       mask_file(job, v, k), error);
    const bool ok = buffer && read_grey(job, v, k, buffer, error) &&
                    fill_mask(job, v, k, remap, buffer, error);
    free(buffer);
    return ok;
}

static void load_mask(saga_load_job *job, int v, int k, const saga_remap *remap)
{
    const saga_capture *const c = job->capture;
    saga_error error = { "" };
    const bool any = mask_file(job, v, k) &&
                     (!c->views[v].single || saga_capture_has(c, v, k));
    const bool ok = !any || read_mask(job, v, k, remap, &error);
    item_done(job, v * c->n_frames + k, ok, &error);
}

static void load_depth(saga_load_job *job, int v, int k,
                       const saga_remap *remap)
{
    const saga_source *const s = &job->listing->sources[v];
    const saga_source_view *const view = &job->capture->views[v];
    const char *const path = s->depths[job->capture->first_frame + k];
    saga_error error = { "" };
    float *const buffer = saga_alloc((size_t)s->width * (size_t)s->height, 4,
                                     path, &error);
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
 * so that code that compares moments sees no motion. The mask that is that
 * picture's opacity comes along. */
static void fill_missing(saga_load_job *job, int v)
{
    const saga_capture *const c = job->capture;
    const saga_source_view *const view = &c->views[v];
    const size_t n = (size_t)view->width * (size_t)view->height;
    for (int k = 0; k < saga_view_n_held(view, c->n_frames); k++) {
        const int from = saga_capture_near(c, v, k);
        if (view->single || saga_capture_has(c, v, k))
            continue;
        memcpy(frame_to_fill(job, v, k), frame_to_fill(job, v, from),
               saga_view_frame_nbytes(view));
        if (view->mask)
            memcpy(view->mask + n * (size_t)k, view->mask + n * (size_t)from,
                   n);
    }
}

/* Refuses a camera of which nothing is left to be trained. */
static bool check_mask(const saga_load_job *job, int v)
{
    const saga_capture *const c = job->capture;
    const saga_source_view *const view = &c->views[v];
    const size_t n = (size_t)view->width * (size_t)view->height *
                     (size_t)saga_view_n_held(view, c->n_frames);
    const char *path = NULL;
    if (view->n_missing == c->n_frames || memchr(view->mask, 1, n))
        return true;
    for (int k = 0; k < c->n_frames && !path; k++)
        path = mask_file(job, v, k) ? mask_file(job, v, k)
                                    : source_file(job, v, k);
    return saga_fail(job->error, path,
                     "make the masks white, or with "
                     "--alpha-masks the pictures opaque, where pixels count; "
                     "or leave the camera out",
                     "its mask leaves no pixel of "
                     "camera %s, and no other mask of this camera does",
                     view->name);
}

/* Fills a pixel that does not count from the nearest frame in which it counts,
 * or with black if there is none. Time is linear in the number of frames. */
static void fill_masked(saga_load_job *job, int v)
{
    const saga_source_view *const view = &job->capture->views[v];
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
                for (next = k;
                     next < n_frames && !counts[(size_t)n * (size_t)next];)
                    next++;
            if (next == k)
                last = k;
            const int from = last >= 0 &&
                                     (next == n_frames || k - last <= next - k)
                                 ? last
                                 : next;
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
    job->n_pictures = n_views * job->capture->n_frames;
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
    /* Missing pictures are filled before masked pixels, since fill_masked may
     * copy from them. */
    for (int v = 0; v < n_views; v++)
        fill_missing(job, v);
    /* Masks come next, unless a subject was cut out by them, then depth;
     * progress begins at 0 for each. */
    job->capture->subject = job->options->subject;
    memcpy(job->capture->box, job->options->box, sizeof job->options->box);
    job->n_done = 0;
    for (int v = 0; v < n_views; v++)
        if (job->listing->sources[v].masks && job->capture->views[v].mask &&
            !job->capture->subject)
            load_view(job, v, MASKS);
    if (job->first_failed != INT32_MAX)
        return false;
    if (job->capture->subject &&
        !saga_subject_check(job->capture, job->listing->path, job->error))
        return false;
    for (int v = 0; v < n_views; v++) {
        if (!job->capture->views[v].mask || job->capture->subject)
            continue;
        if (!check_mask(job, v))
            return false;
        fill_masked(job, v);
    }
    job->n_done = 0;
    for (int v = 0; v < n_views; v++)
        if (job->capture->views[v].depth)
            load_view(job, v, DEPTHS);
    return job->first_failed == INT32_MAX;
}
