/* SPDX-License-Identifier: MIT */
#include "evaluate.h"

#include "alloc.h"
#include "error.h"
#include "file.h"
#include "montage.h"
#include "threads.h"
#include "yuv.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { DIFFERENCE_GAIN = 4 };

/* A view may be so far from the rig's camera it is taken for. */
static const double max_distance = 1e-4; /* of the cube's width */
static const double max_degrees = 0.1;
static const double max_focal = 0.01;    /* scaling crops odd rests */

void saga_eval_free(saga_eval *eval)
{
    for (int i = 0; eval->view && i < eval->n_views; i++)
        free(eval->view[i].picture);
    free(eval->view);
    *eval = (saga_eval){ 0 };
}

/* --- Does it fit? -------------------------------------------------------- */

/* A single frame has no rate that could differ. */
static bool check_time(const saga_film *film, const saga_capture *capture,
                       int first_frame, saga_error *error)
{
    const saga_info *const i = &film->info;
    const double rate = (double)i->fps_num / i->fps_den;

    if (first_frame >= 0 &&
        (uint64_t)first_frame + (uint64_t)capture->n_frames > i->n_frames)
        return saga_fail(error, film->name, "give frames inside it to --only",
                         "has %" PRIu32 " frames, compared would be %d:%d",
                         i->n_frames, first_frame,
                         first_frame + capture->n_frames);
    if (first_frame < 0 && (uint32_t)capture->n_frames != i->n_frames)
        return saga_fail(error, film->name, "give the --frames A:B it was "
                         "encoded with", "has %" PRIu32 " frames, the capture "
                         "gives %d", i->n_frames, capture->n_frames);
    /* Written so that a rate of NaN is refused, too. */
    if (i->n_frames > 1 && !(fabs(capture->fps - rate) <= 1e-3 * rate))
        return saga_fail(error, film->name, "give the capture it was made "
                         "from", "has %g frames per second, the capture %g",
                         rate, capture->fps);
    return true;
}

/* Returns the angle between the poses of two cameras, in degrees. */
static double turn_between(const saga_shot *a, const saga_shot *b)
{
    double trace = 0.0, c;

    /* trace(A^T B) = 1 + 2 cos(angle) for two rotations. */
    for (int i = 0; i < 9; i++)
        trace += a->rotation[i] * b->rotation[i];
    c = 0.5 * (trace - 1.0);
    /* Rounding can take the cosine a little beyond 1,
     * where acos has no value. */
    return acos(fmin(fmax(c, -1.0), 1.0)) * (180.0 / 3.14159265358979323846);
}

static double distance_between(const saga_shot *a, const saga_shot *b)
{
    double p[3], q[3];

    saga_shot_centre(p, a);
    saga_shot_centre(q, b);
    return sqrt((p[0] - q[0]) * (p[0] - q[0]) +
                (p[1] - q[1]) * (p[1] - q[1]) +
                (p[2] - q[2]) * (p[2] - q[2]));
}

/* This separates a view from the rig's camera that is nearest to it. */
typedef struct {
    int rig;
    uint32_t number;
    double distance, degrees, focal; /* metres, -, relative */
} match;

static match nearest(const saga_film *film, const saga_shot *shot)
{
    match best = { -1, 0, 0.0, 0.0, 0.0 };
    double least = (double)INFINITY;

    for (uint32_t i = 0; i < film->info.n_cameras; i++) {
        saga_shot r = { .name = "" };
        saga_camera c;
        match m = { .rig = (int)i };
        double far;

        if (saga_rig(&c, &m.number, film->bytes, film->nbytes, i))
            continue;
        saga_shot_of_camera(&r, &film->metric, &c);
        m.distance = distance_between(&r, shot);
        m.degrees = turn_between(&r, shot);
        /* In parts of the picture's width, so that a capture that was scaled is
         * still the same camera. */
        m.focal = fabs(shot->fx / shot->width * r.width / r.fx - 1.0);
        /* One measure for both: a cube's width counts as
         * much as a quarter turn. */
        far = m.distance / saga_metric_width(&film->metric) + m.degrees / 90.0;
        if (far < least) {
            least = far;
            best = m;
        }
    }
    return best;
}

static bool is_same(const saga_film *film, const match *m)
{
    return m->rig >= 0 && m->degrees <= max_degrees &&
           m->distance <= max_distance * saga_metric_width(&film->metric) &&
           m->focal <= max_focal;
}

static bool refuse_view(const saga_film *film, const saga_shot *shot,
                        const match *m, saga_error *error)
{
    return saga_fail(error, film->name, "give the capture it was made from, "
                     "or name the view in --hold-out",
                     "%s is no camera of its rig: the nearest, number %" PRIu32
                     ", is %.3g m and %.3g degrees away, its focal length "
                     "%.2g %% different", shot->name, m->number, m->distance,
                     m->degrees, 100.0 * m->focal);
}

/* Takes near plane and background of camera `rig`, or guesses without a rig. */
static void borrow(saga_eval_view *v, double *near_metres,
                   const saga_film *film, int rig)
{
    saga_camera c;
    uint32_t number;

    if (saga_rig(&c, &number, film->bytes, film->nbytes, (uint32_t)rig)) {
        /* Without a rig: 2^-10 of the cube's width, and a black background. */
        *near_metres = ldexp(saga_metric_width(&film->metric), -10);
        return;
    }
    *near_metres = film->metric.unit * c.near_plane;
    for (int i = 0; i < 3; i++)
        v->camera.background_q15[i] = c.background_q15[i];
}

static bool match_view(saga_eval_view *v, const saga_film *film,
                       const saga_shot *shot, saga_error *error)
{
    const match m = nearest(film, shot);
    double near_metres;

    *v = (saga_eval_view){ .name = shot->name, .width = shot->width,
                           .height = shot->height, .rig = -1,
                           .held_out = shot->held_out };
    /* A view that is held out need not be in the rig. One that was trained on
     * has to be, else the capture is another one and its PSNR says nothing. */
    if (is_same(film, &m))
        v->rig = m.rig;
    else if (!shot->held_out && film->info.n_cameras)
        return refuse_view(film, shot, &m, error);
    borrow(v, &near_metres, film, v->rig < 0 ? 0 : v->rig);
    return saga_camera_of_shot(&v->camera, &film->metric, shot, near_metres,
                               error);
}

bool saga_eval_match(saga_eval *eval, const saga_film *film,
                     const saga_capture *capture, int first_frame,
                     saga_error *error)
{
    const int n = capture->n_views;
    bool ok = check_time(film, capture, first_frame, error);

    *eval = (saga_eval){ .n_views = n, .n_frames = capture->n_frames,
                         .first_frame = first_frame < 0 ? 0 : first_frame };
    if (ok)
        eval->view =
            saga_calloc((size_t)n, sizeof *eval->view, film->name, error);
    ok = ok && eval->view;
    for (int i = 0; i < n && ok; i++) {
        ok = match_view(&eval->view[i], film, &capture->views[i], error);
        eval->n_training += !capture->views[i].held_out;
        eval->n_held_out += capture->views[i].held_out;
    }
    if (!ok)
        saga_eval_free(eval);
    return ok;
}

static bool match_pictures_of(saga_eval_view *v, const char *name,
                              const saga_shot *made, const saga_shot *shot,
                              saga_error *error)
{
    *v = (saga_eval_view){ .name = shot->name, .width = shot->width,
                           .height = shot->height, .rig = -1,
                           .held_out = shot->held_out };
    if (strcmp(made->name, shot->name) == 0 && made->width == shot->width &&
        made->height == shot->height)
        return true;
    return saga_fail(error, name, "give pictures of the same capture",
                     "has %s of %d x %d where the capture has %s of %d x %d",
                     made->name, made->width, made->height, shot->name,
                     shot->width, shot->height);
}

bool saga_eval_match_pictures(saga_eval *eval, const char *name,
                              const saga_capture *pictures,
                              const saga_capture *capture, saga_error *error)
{
    const int n = capture->n_views;
    bool ok = (pictures->n_views == n &&
               pictures->n_frames == capture->n_frames) ||
              saga_fail(error, name, "give pictures of the same capture",
                        "has %d views of %d frames, the capture %d of %d",
                        pictures->n_views, pictures->n_frames, n,
                        capture->n_frames);

    *eval = (saga_eval){ .n_views = n, .n_frames = capture->n_frames };
    if (ok)
        eval->view = saga_calloc((size_t)n, sizeof *eval->view, name, error);
    ok = ok && eval->view;
    for (int i = 0; i < n && ok; i++) {
        ok = match_pictures_of(&eval->view[i], name, &pictures->views[i],
                               &capture->views[i], error);
        eval->n_training += !capture->views[i].held_out;
        eval->n_held_out += capture->views[i].held_out;
    }
    if (!ok)
        saga_eval_free(eval);
    return ok;
}

/* --- The comparison ------------------------------------------------------ */

/* These are sums of products over all pixels of a channel. */
typedef struct { uint64_t made_made, made_true, true_true; } tones;

typedef struct {
    saga_eval *eval;
    const saga_eval_maker *maker;
    const saga_capture *capture;
    const saga_eval_options *options;
    saga_error *error;
    int n_threads;
    uint8_t *rgb;           /* of the largest view: a decoded picture */
    const uint8_t **frame;  /* (n_frames) of one view */
    uint8_t **median;       /* (n_views) its temporal median picture */
    uint8_t **before;       /* (n_views) what was made of the frame before */
    saga_score_sum *sum;    /* (n_views) */
    tones *tone;            /* (n_views, 3) */
} comparison;

/* Makes the median pictures, of the truth alone, and room for the pictures of
 * the frame before. */
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
    const saga_still truth = {
        saga_capture_frame(c->capture, view, frame), v->width, v->height
    };
    const saga_still decode = { c->rgb, v->width, v->height };
    char name[SAGA_NAME_NBYTES + 16];
    char *path;
    bool ok;

    if (!c->options->pictures ||
        frame != saga_capture_near(c->capture, view, c->eval->n_frames / 2))
        return true;
    v->picture_frame = c->eval->first_frame + frame;
    (void)snprintf(name, sizeof name, "%s_%05d.png", v->name,
                   v->picture_frame);
    path = saga_path_join(c->options->pictures, name, c->error);
    ok = path && saga_montage_compare(path, &truth, &decode, DIFFERENCE_GAIN,
                                      c->error);
    v->picture = path;
    return ok;
}

/* Adds to the view's score what its median picture is worth, and how the
 * decoded one does where something changes. */
static void compare_change(const comparison *c, int view, int frame)
{
    const uint8_t *const truth = saga_capture_frame(c->capture, view, frame);
    const uint8_t *const median = c->median[view];
    const size_t n = saga_view_frame_nbytes(&c->capture->views[view]);
    const double mse = saga_mse(median, truth, n);
    const int n_frames =
        c->eval->n_frames - c->capture->views[view].n_missing;
    saga_eval_score *const s = &c->eval->view[view].score;

    /* The missing frames of a view are in no mean, so
     * they are not divided by. */
    s->median_mse += mse / n_frames;
    s->median_psnr += saga_psnr(mse) / n_frames;
    saga_change_add(&s->change, median, truth, c->rgb, n / 3);
}

/* Returns the mean squared error of what changes from the pictures a0, b0 to
 * a1, b1. */
static double change_mse(const uint8_t *a0, const uint8_t *a1,
                         const uint8_t *b0, const uint8_t *b1, size_t n)
{
    uint64_t sum = 0;

    for (size_t i = 0; i < n; i++) {
        /* The difference of differences: an error that stays is no flicker. */
        const int d = a1[i] - a0[i] - (b1[i] - b0[i]);

        sum += (uint64_t)(d * d);
    }
    return (double)sum / (double)n;
}

/* Flicker and lag show in how pictures follow each other; both of them must be
 * there. */
static void compare_time(const comparison *c, int view, int frame)
{
    const size_t n = saga_view_frame_nbytes(&c->capture->views[view]);
    saga_eval_score *const s = &c->eval->view[view].score;

    if (frame > 0 && saga_capture_has(c->capture, view, frame - 1)) {
        s->temporal_mse += change_mse(
            c->before[view], c->rgb,
            saga_capture_frame(c->capture, view, frame - 1),
            saga_capture_frame(c->capture, view, frame), n);
        s->n_steps++;
    }
    /* Kept for the next frame, also where this one could not be compared. */
    memcpy(c->before[view], c->rgb, n);
}

static void compare_tones(const comparison *c, int view, int frame)
{
    const uint8_t *const truth = saga_capture_frame(c->capture, view, frame);
    const size_t n = saga_view_frame_nbytes(&c->capture->views[view]);

    for (size_t k = 0; k < 3; k++) {
        tones *const t = &c->tone[3 * (size_t)view + k];

        for (size_t i = k; i < n; i += 3) {
            t->made_made += (uint64_t)(c->rgb[i] * c->rgb[i]);
            t->made_true += (uint64_t)(c->rgb[i] * truth[i]);
            t->true_true += (uint64_t)(truth[i] * truth[i]);
        }
    }
}

/* The mean of (f x made - truth)^2, of the best f for each channel. */
static double exposed_mse(const comparison *c, int view)
{
    const saga_shot *const v = &c->capture->views[view];
    const double n = (double)saga_view_frame_nbytes(v) *
                     (c->eval->n_frames - v->n_missing);
    double sum = 0;

    for (size_t k = 0; k < 3; k++) {
        const tones *const t = &c->tone[3 * (size_t)view + k];
        const double both = (double)t->made_true;

        /* The sum of (f m - t)^2 is least at f = (m t) / (m m), where it is
         * t t - (m t)^2 / (m m). */
        sum += (double)t->true_true;
        if (t->made_made > 0)
            sum -= both * both / (double)t->made_made;
    }
    return sum / n;
}

/* Scores a pair of pictures by all that is wanted. */
static bool score_pair(saga_score *score, const saga_picture_pair *pair,
                       const comparison *c)
{
    const saga_eval_options *const o = c->options;
    saga_yuv_score yuv;

    if (o->no_ssim)
        *score = saga_score_psnr(pair);
    else if (!saga_score_picture(score, pair, c->error))
        return false;
    /* IV-PSNR tries 25 places for each pixel, which takes time: it is left
     * out together with SSIM. */
    if (!saga_yuv_compare(&yuv, pair, o->equirect, !o->no_ssim, c->error))
        return false;
    score->psnr_y = yuv.psnr[0];
    score->psnr_u = yuv.psnr[1];
    score->psnr_v = yuv.psnr[2];
    score->psnr_yuv = yuv.psnr_yuv;
    score->ws_psnr = yuv.ws_psnr;
    score->iv_psnr = yuv.iv_psnr;
    return !o->lpips || saga_lpips_distance(&score->lpips, o->lpips, pair,
                                            c->error);
}

/* Makes the means of squares those of the pixels that count, a part of all; the
 * others are right. */
static void count_alone(saga_score *s, double counting)
{
    const double gain = 10 * log10(counting);

    if (!(counting > 0.0 && counting < 1.0))
        return;
    /* The error is spread over all pixels; over those that count it is larger
     * by 1 / counting, and a PSNR smaller by that in dB. */
    s->mse /= counting;
    s->psnr += gain;
    s->psnr_of_mean += gain;
    s->psnr_y += gain;
    s->psnr_u += gain;
    s->psnr_v += gain;
    s->psnr_yuv += gain;
}

static bool make_picture(const comparison *c, int view, int frame)
{
    const saga_eval_maker *const m = c->maker;

    if (m->film)
        return saga_film_draw_late(m->film, &c->eval->view[view].camera,
                                   (uint32_t)(c->eval->first_frame + frame),
                                   c->capture->views[view].late, c->rgb,
                                   c->error);
    memcpy(c->rgb, saga_capture_frame(m->pictures, view, frame),
           saga_view_frame_nbytes(&m->pictures->views[view]));
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
    if (!make_picture(c, view, frame))
        return false;
    /* What does not count gets the pixels of the truth, and so no error. */
    counting = saga_capture_forgive(c->capture, view, frame, c->rgb);
    if (counting == 0.0) { /* nothing to judge */
        compare_time(c, view, frame);
        return true;
    }
    if (!score_pair(&score, &pair, c))
        return false;
    count_alone(&score, counting);
    /* Sums of the view, in the order of frames; means are taken at the end. */
    saga_score_add(&c->sum[view], &score);
    compare_change(c, view, frame);
    compare_time(c, view, frame);
    compare_tones(c, view, frame);
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
    return c->options->progress(c->options->progress_user, done / all,
                                doing) ||
           saga_fail(c->error, NULL, NULL, "cancelled");
}

/* Goes frame by frame, so that each segment is decoded once. */
static bool compare_all(const comparison *c)
{
    for (int frame = 0; frame < c->eval->n_frames; frame++)
        for (int view = 0; view < c->eval->n_views; view++)
            if (!compare_one(c, view, frame) || !progress(c, view, frame))
                return false;
    return true;
}

/* Mean over the views that are held out, or over those that are not. */
static saga_eval_score mean_of(const saga_eval *eval, bool held_out)
{
    saga_score_sum decode = { .n = 0 };
    saga_eval_score mean = { .median_psnr = 0.0 };
    double n;

    for (int i = 0; i < eval->n_views; i++) {
        const saga_eval_score *const s = &eval->view[i].score;

        if (eval->view[i].held_out != held_out || isnan(s->decode.psnr))
            continue; /* NaN: all of its pictures are missing */
        saga_score_add(&decode, &s->decode);
        mean.median_psnr += s->median_psnr;
        mean.median_mse += s->median_mse;
        mean.temporal_mse += s->temporal_mse;
        mean.exposed_mse += s->exposed_mse;
        saga_change_merge(&mean.change, &s->change);
    }
    /* All views weigh the same, but for the changing pixels, which were pooled
     * above: a view without motion has hardly any say there. */
    n = decode.n ? (double)decode.n : (double)NAN;
    mean.decode = saga_score_mean(&decode);
    mean.median_psnr /= n;
    mean.median_mse /= n;
    mean.temporal_mse /= n;
    mean.exposed_mse /= n;
    return mean;
}

static void take_means(const comparison *c)
{
    for (int i = 0; i < c->eval->n_views; i++) {
        saga_eval_score *const s = &c->eval->view[i].score;

        s->decode = saga_score_mean(&c->sum[i]);
        s->temporal_mse /= s->n_steps ? s->n_steps : (double)NAN;
        s->exposed_mse = exposed_mse(c, i);
    }
    c->eval->training = mean_of(c->eval, false);
    c->eval->held_out = mean_of(c->eval, true);
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
    const int why = errno; /* looking at it sets another one */
    if (saga_path_is_folder(path))
        return true;
    errno = why;
    return saga_fail_errno(error, path, "give another folder for the pictures",
                           "cannot be made");
}

/* Allocates the memory of a comparison; release gives back what there is of it.
 */
static bool allocate(comparison *c)
{
    const size_t n_views = (size_t)c->eval->n_views;
    const size_t n_frames = (size_t)c->eval->n_frames;
    const char *const name = c->maker->name;

    c->rgb = saga_alloc(largest(c->eval), 1, name, c->error);
    c->frame = saga_calloc(n_frames, sizeof *c->frame, name, c->error);
    c->median = saga_calloc(n_views, sizeof *c->median, name, c->error);
    c->before = saga_calloc(n_views, sizeof *c->before, name, c->error);
    c->sum = saga_calloc(n_views, sizeof *c->sum, name, c->error);
    c->tone = saga_calloc(3 * n_views, sizeof *c->tone, name, c->error);
    return c->rgb && c->frame && c->median && c->before && c->sum && c->tone;
}

static void release(const comparison *c)
{
    for (int i = 0; c->median && i < c->eval->n_views; i++)
        free(c->median[i]);
    for (int i = 0; c->before && i < c->eval->n_views; i++)
        free(c->before[i]);
    free(c->rgb);
    free(c->frame);
    free(c->median);
    free(c->before);
    free(c->sum);
    free(c->tone);
}

bool saga_eval_run(saga_eval *eval, const saga_eval_maker *maker,
                   const saga_capture *capture,
                   const saga_eval_options *options, saga_error *error)
{
    comparison c = { .eval = eval, .maker = maker, .capture = capture,
                     .options = options, .error = error,
                     .n_threads = maker->n_threads > 0 ? maker->n_threads
                                                       : (int)saga_n_threads()
                   };
    const bool ok = make_folder(options->pictures, error) && allocate(&c) &&
                    make_medians(&c) && compare_all(&c);

    if (ok)
        take_means(&c);
    release(&c);
    return ok;
}
