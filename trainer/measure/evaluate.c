/* SPDX-License-Identifier: MIT
 *
 * Single pictures are compared in score.h. The metrics of a view over its
 * frames are computed here: median picture, changing pixels, flicker, exposure,
 * opacity.
 */
#include "evaluate.h"

#include "alloc.h"
#include "change.h"
#include "error.h"
#include "exposure.h"
#include "file.h"
#include "montage.h"
#include "threads.h"

#include <errno.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { DIFFERENCE_GAIN = 4 };

/* --- The comparison ------------------------------------------------------ */

/* Sums for one view over its frames. */
typedef struct {
    saga_score_sum each;            /* scores of single pictures */
    saga_change change;             /* over changing pixels */
    double median_psnr, median_mse; /* results of the temporal median picture */
    double temporal_mse; /* error of the change from frame to frame */
    int n_steps;         /* number of pairs of frames in temporal_mse */
    saga_exposure_sums exposure[3]; /* sums for each channel */
    size_t n_exposed;               /* number of pixels in exposure */
    double both, any; /* sums over pixels of the smaller and of the larger of
                       * opacity and mask */
} sums;

typedef struct {
    saga_eval *eval;
    const saga_eval_maker *maker;
    const saga_capture *capture;
    const saga_eval_options *options;
    saga_error *error;
    int n_threads;
    uint8_t *rgb;          /* the decoded picture; sized for the largest view */
    saga_depth *opacity;   /* its opacities; NULL: they are not compared */
    const uint8_t **frame; /* (n_frames) the pictures of one view */
    uint8_t **median;      /* (n_views) temporal median pictures */
    uint8_t **before; /* (n_views) decoded pictures of the previous frame */
    sums *sum;        /* (n_views) */
} comparison;

/* Computes the median pictures of the captured frames, and allocates the
 * pictures of the previous frame. */
static bool make_medians(const comparison *c)
{
    for (int i = 0; i < c->eval->n_views; i++) {
        const size_t n = saga_view_frame_nbytes(&c->capture->views[i]);

        c->median[i] = saga_alloc(n, 1, c->eval->view[i].name, c->error);
        c->before[i] = saga_alloc(n, 1, c->eval->view[i].name, c->error);
        if (!c->median[i] || !c->before[i])
            return false;
        for (int k = 0; k < c->eval->n_frames; k++)
            c->frame[k] = saga_capture_frame(c->capture, i, k);
        saga_median_picture(c->median[i], c->frame, c->eval->n_frames, n,
                            c->n_threads);
    }
    return true;
}

static bool write_picture(const comparison *c, int view, int frame)
{
    saga_eval_view *const v = &c->eval->view[view];
    const saga_still truth = { saga_capture_frame(c->capture, view, frame),
                               v->width, v->height };
    const saga_still decode = { c->rgb, v->width, v->height };
    char name[SAGA_NAME_NBYTES + 16];
    char *path;
    bool ok;

    /* Only the middle frame is written, or the nearest one that the view
     * has. */
    if (!c->options->pictures ||
        frame != saga_capture_near(c->capture, view, c->eval->n_frames / 2))
        return true;
    v->picture_frame = c->eval->first_frame + frame;
    (void)snprintf(name, sizeof name, "%s_%05d.png", v->name, v->picture_frame);
    path = saga_path_join(c->options->pictures, name, c->error);
    ok = path &&
         saga_montage_compare(path, &truth, &decode, DIFFERENCE_GAIN, c->error);
    v->picture = path;
    return ok;
}

/* Adds the errors of the view's median picture to its sums, and the decoded
 * picture's errors at changing pixels. */
static void compare_change(const comparison *c, int view, int frame)
{
    const uint8_t *const truth = saga_capture_frame(c->capture, view, frame);
    const uint8_t *const median = c->median[view];
    const size_t n = saga_view_frame_nbytes(&c->capture->views[view]);
    const double mse = saga_mse(median, truth, n);
    sums *const s = &c->sum[view];

    s->median_mse += mse;
    s->median_psnr += saga_psnr(mse);
    saga_change_add(&s->change, median, truth, c->rgb, n / 3);
}

/* Returns the mean squared error between two changes: from a0 to a1, and from
 * b0 to b1. */
static double change_mse(const uint8_t *a0, const uint8_t *a1,
                         const uint8_t *b0, const uint8_t *b1, size_t n)
{
    uint64_t sum = 0;

    for (size_t i = 0; i < n; i++) {
        /* The difference of differences: a constant error is no flicker. */
        const int d = a1[i] - a0[i] - (b1[i] - b0[i]);

        sum += (uint64_t)(d * d);
    }
    return (double)sum / (double)n;
}

/* Adds the error of the change since the previous frame, which shows flicker
 * and lag; both frames must exist in the capture. */
static void compare_time(const comparison *c, int view, int frame)
{
    const size_t n = saga_view_frame_nbytes(&c->capture->views[view]);
    sums *const s = &c->sum[view];

    if (frame > 0 && saga_capture_has(c->capture, view, frame - 1)) {
        s->temporal_mse += change_mse(
            c->before[view], c->rgb,
            saga_capture_frame(c->capture, view, frame - 1),
            saga_capture_frame(c->capture, view, frame), n);
        s->n_steps++;
    }
    /* Kept for the next frame even if this frame was not compared. */
    memcpy(c->before[view], c->rgb, n);
}

/* Returns the mean of (f x made - truth)^2, with the best factor f for each
 * channel. */
static double exposed_mse(const comparison *c, int view)
{
    const sums *const s = &c->sum[view];

    return saga_exposure_error(s->exposure) / (3.0 * (double)s->n_exposed);
}

bool saga_eval_draw_film(void *state, uint8_t *rgb, const saga_eval *eval,
                         int view, int frame, saga_error *error)
{
    const saga_eval_view *const v = &eval->view[view];

    if (!saga_film_draw_late(state, &v->camera,
                             (uint32_t)(eval->first_frame + frame), v->late,
                             rgb, error))
        return false;
    if (v->rig >= 0)
        saga_film_expose(state, (uint32_t)v->rig, rgb,
                         (size_t)v->width * (size_t)v->height);
    return true;
}

bool saga_eval_draw_pictures(void *state, uint8_t *rgb, const saga_eval *eval,
                             int view, int frame, saga_error *error)
{
    const saga_capture *const pictures = state;

    (void)eval;
    (void)error;
    memcpy(rgb, saga_capture_frame(pictures, view, frame),
           saga_view_frame_nbytes(&pictures->views[view]));
    return true;
}

bool saga_eval_film_opacity(void *state, saga_depth *opacity,
                            const saga_eval *eval, int view, int frame,
                            saga_error *error)
{
    const saga_eval_view *const v = &eval->view[view];

    return saga_film_draw_depth_late(state, &v->camera,
                                     (uint32_t)(eval->first_frame + frame),
                                     v->late, opacity, error);
}

/* Adds the overlap of opacity and mask, both 0..1, over all pixels. Unlike the
 * other metrics it sees what floats outside the subject. */
static bool compare_opacity(const comparison *c, int view, int frame)
{
    const saga_eval_view *const v = &c->eval->view[view];
    const uint8_t *const mask = saga_capture_mask(c->capture, view, frame);
    const size_t n = (size_t)v->width * (size_t)v->height;
    sums *const s = &c->sum[view];

    if (!c->opacity)
        return true;
    if (!c->maker->opacity(c->maker->state, c->opacity, c->eval, view, frame,
                           c->error))
        return false;
    for (size_t i = 0; i < n; i++) {
        const double a = c->opacity[i].weight_q16 / 65536.0;
        const double b = mask[i] / 255.0;

        s->both += fmin(a, b);
        s->any += fmax(a, b);
    }
    return true;
}

static bool compare_one(const comparison *c, int view, int frame)
{
    const saga_eval_view *const v = &c->eval->view[view];
    const saga_picture_pair pair = {
        c->rgb, saga_capture_frame(c->capture, view, frame), v->width,
        v->height, c->n_threads
    };
    saga_score score;
    double counting;

    if (!saga_capture_has(c->capture, view, frame))
        return true;
    if (!c->maker->draw(c->maker->state, c->rgb, c->eval, view, frame,
                        c->error) ||
        !compare_opacity(c, view, frame))
        return false;
    /* Pixels that do not count are set to the truth, so that they have no
     * error. */
    counting = saga_capture_forgive(c->capture, view, frame, c->rgb);
    if (counting == 0.0) { /* no pixel counts */
        compare_time(c, view, frame);
        return true;
    }
    if (!saga_score_pair(&score, &pair, counting, &c->options->score, c->error))
        return false;
    /* Sums are taken in the order of frames; means are formed at the end. */
    saga_score_add(&c->sum[view].each, &score);
    compare_change(c, view, frame);
    compare_time(c, view, frame);
    c->sum[view].n_exposed += saga_exposure_add(
        c->sum[view].exposure, pair.a, pair.b,
        saga_capture_mask(c->capture, view, frame),
        (size_t)v->width * (size_t)v->height);
    return write_picture(c, view, frame);
}

static bool progress(const comparison *c, int view, int frame)
{
    const double all = (double)c->eval->n_frames * c->eval->n_views;
    const double done = (double)frame * c->eval->n_views + view + 1;
    char doing[128];

    if (!c->options->progress)
        return true;
    (void)snprintf(doing, sizeof doing, "frame %d of %d, %s", frame + 1,
                   c->eval->n_frames, c->eval->view[view].name);
    return c->options->progress(c->options->progress_user, done / all, doing) ||
           saga_fail(c->error, NULL, NULL, "cancelled");
}

/* Frames are the outer loop, so that each segment is decoded once. */
static bool compare_all(const comparison *c)
{
    for (int frame = 0; frame < c->eval->n_frames; frame++)
        for (int view = 0; view < c->eval->n_views; view++)
            if (!compare_one(c, view, frame) || !progress(c, view, frame))
                return false;
    return true;
}

static void set(saga_score *score, const char *key, double value)
{
    score->value[saga_metric_called(key)] = value;
}

static void set_change(saga_score *score, const saga_change *change)
{
    set(score, "changing_psnr", saga_change_psnr(change));
    set(score, "changing_share", saga_change_share(change));
    set(score, "changing_pixels", (double)change->n_changing);
}

/* Returns the mean over the held-out views, or over the training views. All
 * views weigh the same, except for changing pixels, which are averaged over all
 * views together: a view with little motion then counts little. */
static saga_score mean_of(const comparison *c, bool held_out)
{
    const int psnr = saga_metric_called("psnr");
    saga_score_sum sum = { .n = 0 };
    saga_change change = { 0 };
    saga_score mean;

    for (int i = 0; i < c->eval->n_views; i++) {
        const saga_eval_view *const v = &c->eval->view[i];

        if (v->held_out != held_out || isnan(v->score.value[psnr]))
            continue; /* NaN: all its pictures are missing */
        saga_score_add(&sum, &v->score);
        saga_change_merge(&change, &c->sum[i].change);
    }
    mean = saga_score_mean(&sum);
    set_change(&mean, &change);
    return mean;
}

static void take_means(const comparison *c)
{
    for (int i = 0; i < c->eval->n_views; i++) {
        saga_score *const score = &c->eval->view[i].score;
        const sums *const s = &c->sum[i];

        /* Frames that are missing, or that a mask excludes entirely, are in no
         * mean. */
        *score = saga_score_mean(&s->each);
        set(score, "median_psnr", s->median_psnr / s->each.n);
        set(score, "median_psnr_of_mean_mse", s->median_mse / s->each.n);
        set(score, "temporal_psnr",
            s->temporal_mse / (s->n_steps ? s->n_steps : (double)NAN));
        set(score, "psnr_exposed", exposed_mse(c, i));
        set(score, "iou", s->any > 0 ? s->both / s->any : (double)NAN);
        set_change(score, &s->change);
    }
    c->eval->training = mean_of(c, false);
    c->eval->held_out = mean_of(c, true);
}

static size_t largest(const saga_eval *eval)
{
    size_t n = 0;

    for (int i = 0; i < eval->n_views; i++) {
        const size_t one = 3 * (size_t)eval->view[i].width *
                           (size_t)eval->view[i].height;

        n = one > n ? one : n;
    }
    return n;
}

static bool make_folder(const char *path, saga_error *error)
{
    if (!path || mkdir(path, 0777) == 0)
        return true;
    const int why = errno; /* saga_path_is_folder overwrites errno */
    if (saga_path_is_folder(path))
        return true;
    errno = why;
    return saga_fail_errno(error, path, "give another folder for the pictures",
                           "cannot be made");
}

/* Allocates the memory of a comparison. If it fails, release() frees what has
 * been allocated. */
static bool allocate(comparison *c)
{
    const size_t n_views = (size_t)c->eval->n_views;
    const size_t n_frames = (size_t)c->eval->n_frames;
    const char *const name = c->maker->name;

    if (c->capture->subject && c->maker->opacity) {
        c->opacity = saga_alloc(largest(c->eval) / 3, sizeof *c->opacity, name,
                                c->error);
        if (!c->opacity)
            return false;
    }
    c->rgb = saga_alloc(largest(c->eval), 1, name, c->error);
    c->frame = saga_calloc(n_frames, sizeof *c->frame, name, c->error);
    c->median = saga_calloc(n_views, sizeof *c->median, name, c->error);
    c->before = saga_calloc(n_views, sizeof *c->before, name, c->error);
    c->sum = saga_calloc(n_views, sizeof *c->sum, name, c->error);
    return c->rgb && c->frame && c->median && c->before && c->sum;
}

static void release(const comparison *c)
{
    for (int i = 0; c->median && i < c->eval->n_views; i++)
        free(c->median[i]);
    for (int i = 0; c->before && i < c->eval->n_views; i++)
        free(c->before[i]);
    free(c->rgb);
    free(c->opacity);
    free(c->frame);
    free(c->median);
    free(c->before);
    free(c->sum);
}

bool saga_eval_run(saga_eval *eval, const saga_eval_maker *maker,
                   const saga_capture *capture,
                   const saga_eval_options *options, saga_error *error)
{
    comparison c = { .eval = eval,
                     .maker = maker,
                     .capture = capture,
                     .options = options,
                     .error = error,
                     .n_threads = maker->n_threads > 0
                                      ? maker->n_threads
                                      : (int)saga_n_threads() };
    const bool ok = make_folder(options->pictures, error) && allocate(&c) &&
                    make_medians(&c) && compare_all(&c);

    if (ok)
        take_means(&c);
    release(&c);
    return ok;
}
