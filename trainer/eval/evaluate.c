/* SPDX-License-Identifier: MIT */
#include "evaluate.h"

#include "input.h"
#include "montage.h"

#include <errno.h>
#include <inttypes.h>
#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/stat.h>

enum { DIFFERENCE_GAIN = 4 };

/* How far a view may be from the rig's camera it is taken for. */
static const double max_distance = 1e-4; /* of the cube's width */
static const double max_degrees = 0.1;
static const double max_focal = 0.01;    /* scaling crops odd rests */

void saga_eval_free(saga_eval *eval)
{
    free(eval->view);
    *eval = (saga_eval){ 0 };
}

/* --- Does it fit? -------------------------------------------------------- */

static bool check_time(const saga_film *film, const saga_capture *capture,
                       saga_input_error *error)
{
    const saga_info *const i = &film->info;
    const double rate = (double)i->rate_num / i->rate_den;

    if ((uint32_t)capture->n_frames != i->n_frames)
        return saga_fail(error, film->name, "give the --frames A:B it was "
                         "encoded with", "has %" PRIu32 " frames, the capture "
                         "gives %d", i->n_frames, capture->n_frames);
    if (!(fabs(capture->fps - rate) <= 1e-3 * rate))
        return saga_fail(error, film->name, "give the capture it was made "
                         "from", "has %g frames per second, the capture %g",
                         rate, capture->fps);
    return true;
}

/* Angle between the poses of two cameras, degrees. */
static double turn_between(const saga_shot *a, const saga_shot *b)
{
    double trace = 0.0, c;

    for (int i = 0; i < 9; i++)
        trace += a->rotation[i] * b->rotation[i];
    c = 0.5 * (trace - 1.0);
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

/* What separates a view from the rig's camera that is nearest to it. */
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
        m.focal = fabs(shot->fx / shot->width * r.width / r.fx - 1.0);
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
                        const match *m, saga_input_error *error)
{
    return saga_fail(error, film->name, "give the capture it was made from, "
                     "or name the view in --hold-out",
                     "%s is no camera of its rig: the nearest, number %" PRIu32
                     ", is %.3g m and %.3g degrees away, its focal length "
                     "%.2g %% different", shot->name, m->number, m->distance,
                     m->degrees, 100.0 * m->focal);
}

/* Near plane and background: of camera `rig`, or without a rig a guess. */
static void borrow(saga_eval_view *v, double *near_metres,
                   const saga_film *film, int rig)
{
    saga_camera c;
    uint32_t number;

    if (saga_rig(&c, &number, film->bytes, film->nbytes, (uint32_t)rig)) {
        *near_metres = ldexp(saga_metric_width(&film->metric), -10);
        return;
    }
    *near_metres = film->metric.unit * c.near_plane;
    for (int i = 0; i < 3; i++)
        v->camera.background_q15[i] = c.background_q15[i];
}

static bool match_view(saga_eval_view *v, const saga_film *film,
                       const saga_shot *shot, saga_input_error *error)
{
    const match m = nearest(film, shot);
    double near_metres;

    *v = (saga_eval_view){ .name = shot->name, .width = shot->width,
                           .height = shot->height, .rig = -1,
                           .held_out = shot->held_out };
    if (is_same(film, &m))
        v->rig = m.rig;
    else if (!shot->held_out && film->info.n_cameras)
        return refuse_view(film, shot, &m, error);
    borrow(v, &near_metres, film, v->rig < 0 ? 0 : v->rig);
    return saga_camera_of_shot(&v->camera, &film->metric, shot, near_metres,
                               error);
}

bool saga_eval_match(saga_eval *eval, const saga_film *film,
                     const saga_capture *capture, saga_input_error *error)
{
    const int n = capture->n_views;
    bool ok = check_time(film, capture, error);

    *eval = (saga_eval){ .n_views = n, .n_frames = capture->n_frames };
    eval->view = ok ? saga_calloc((size_t)n, sizeof *eval->view) : NULL;
    if (ok && !eval->view)
        ok = saga_fail(error, film->name, "free some memory", "no memory");
    for (int i = 0; i < n && ok; i++) {
        ok = match_view(&eval->view[i], film, &capture->views[i], error);
        eval->n_training += !capture->views[i].held_out;
        eval->n_held_out += capture->views[i].held_out;
    }
    if (!ok)
        saga_eval_free(eval);
    return ok;
}

/* --- The comparison ------------------------------------------------------ */

typedef struct {
    saga_eval *eval;
    saga_film *film;
    const saga_capture *capture;
    const saga_eval_options *options;
    saga_input_error *error;
    uint8_t *rgb;           /* of the largest view */
    saga_score_sum *sum;    /* (n_views) */
} comparison;

static bool write_picture(const comparison *c, int view, int frame)
{
    const saga_eval_view *const v = &c->eval->view[view];
    const saga_still truth = {
        saga_capture_frame(c->capture, view, frame), v->width, v->height
    };
    const saga_still decode = { c->rgb, v->width, v->height };
    char name[SAGA_NAME_NBYTES + 16];
    char *path;
    bool ok;

    if (!c->options->pictures || frame != c->eval->n_frames / 2)
        return true;
    (void)snprintf(name, sizeof name, "%s_%05d.png", v->name, frame);
    path = saga_path_join(c->options->pictures, name);
    ok = path && saga_montage_compare(path, &truth, &decode, DIFFERENCE_GAIN,
                                      c->error);
    free(path);
    return ok;
}

static bool compare_one(const comparison *c, int view, int frame)
{
    const saga_eval_view *const v = &c->eval->view[view];
    saga_score score;

    if (!saga_film_draw(c->film, &v->camera, (uint32_t)frame, 1, c->rgb,
                        c->error))
        return false;
    if (!saga_score_picture(&score, c->rgb,
                            saga_capture_frame(c->capture, view, frame),
                            v->width, v->height, c->film->n_threads))
        return saga_fail(c->error, v->name, "free some memory",
                         "no memory to compare its pictures");
    saga_score_add(&c->sum[view], &score);
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

/* Frame by frame, so that each segment is decoded once. */
static bool compare_all(const comparison *c)
{
    for (int frame = 0; frame < c->eval->n_frames; frame++)
        for (int view = 0; view < c->eval->n_views; view++)
            if (!compare_one(c, view, frame) || !progress(c, view, frame))
                return false;
    return true;
}

static void take_means(const comparison *c)
{
    saga_score_sum training = { .n = 0 }, held_out = { .n = 0 };

    for (int i = 0; i < c->eval->n_views; i++) {
        saga_eval_view *const v = &c->eval->view[i];

        v->score = saga_score_mean(&c->sum[i]);
        saga_score_add(v->held_out ? &held_out : &training, &v->score);
    }
    c->eval->training = saga_score_mean(&training);
    c->eval->held_out = saga_score_mean(&held_out);
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

static bool make_folder(const char *path, saga_input_error *error)
{
    if (!path || mkdir(path, 0777) == 0 || saga_path_is_folder(path))
        return true;
    return saga_fail(error, path, "give another folder for the pictures",
                     "cannot be made (%s)", strerror(errno));
}

bool saga_eval_run(saga_eval *eval, saga_film *film,
                   const saga_capture *capture,
                   const saga_eval_options *options,
                   saga_input_error *error)
{
    comparison c = { eval, film, capture, options, error, NULL, NULL };
    bool ok = make_folder(options->pictures, error);

    c.rgb = saga_alloc(largest(eval), 1);
    c.sum = saga_calloc((size_t)eval->n_views, sizeof *c.sum);
    if (ok && (!c.rgb || !c.sum))
        ok = saga_fail(error, film->name, "free some memory", "no memory");
    ok = ok && compare_all(&c);
    if (ok)
        take_means(&c);
    free(c.rgb);
    free(c.sum);
    return ok;
}
