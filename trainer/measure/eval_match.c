/* SPDX-License-Identifier: MIT
 *
 * A file is evaluated only with the capture from which it was made: cameras,
 * frames and frame rate are compared first.
 */
#include "evaluate.h"

#include "alloc.h"
#include "error.h"
#include "vec3.h"

#include <inttypes.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Tolerances between a view and the rig's camera that it is taken for. */
typedef struct tolerance {
    double distance; /* as a fraction of the cube's width */
    double degrees;
    double focal; /* relative; scaling a picture may crop odd
                   * sides */
} tolerance;

static const tolerance unchanged = { 1e-4, 0.1, 0.01 };
/* A camera with the view's name may have been refined by `saga encode`, which
 * prefers rotations below 1.1 degrees, shifts below 2 % of the depth and focal
 * lengths that change by less than 3 %. A cube is several depths wide; with
 * 0.05 a camera of the ring that had stepped forward by a third of its distance
 * was taken for the one that had not. */
static const tolerance refined = { 0.02, 3.0, 0.1 };

void saga_eval_free(saga_eval *eval)
{
    for (int i = 0; eval->view && i < eval->n_views; i++)
        free(eval->view[i].picture);
    free(eval->view);
    *eval = (saga_eval){ 0 };
}

/* A single frame has no rate that could differ. */
static bool check_time(const saga_film *film, const saga_capture *capture,
                       int first_frame, saga_error *error)
{
    const saga_info *const i = &film->info;
    const double rate = (double)i->fps_num / i->fps_den;

    if (first_frame >= 0 &&
        (uint64_t)first_frame + (uint64_t)capture->n_frames > i->n_frames)
        return saga_fail(error, film->name,
                         "give --compare a range within the "
                         "file",
                         "has %" PRIu32 " frames, compared would be %d:%d",
                         i->n_frames, first_frame,
                         first_frame + capture->n_frames);
    if (first_frame < 0 && (uint32_t)capture->n_frames != i->n_frames)
        return saga_fail(error, film->name,
                         "give the --frames A:B it was "
                         "encoded with",
                         "has %" PRIu32 " frames, the capture "
                         "gives %d",
                         i->n_frames, capture->n_frames);
    /* The condition is negated so that a NaN rate is refused, too. */
    if (i->n_frames > 1 && !(fabs(capture->fps - rate) <= 1e-3 * rate))
        return saga_fail(error, film->name,
                         "give the capture it was made "
                         "from",
                         "has %g frames per second, the capture %g", rate,
                         capture->fps);
    return true;
}

/* Returns the angle between the poses of two cameras, in degrees. */
static double turn_between(const saga_source_view *a, const saga_source_view *b)
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

static double distance_between(const saga_source_view *a,
                               const saga_source_view *b)
{
    double p[3], q[3];

    saga_source_view_centre(p, a);
    saga_source_view_centre(q, b);
    return distance3(p, q);
}

/* How a view differs from the rig's camera that is nearest to it. */
typedef struct {
    int rig;
    uint32_t number;
    double distance, degrees, focal; /* metres, degrees, relative */
} match;

/* Compares a view with camera `index` of the rig. If the file has no such
 * camera, the result's rig is -1. */
static match compare(const saga_film *film, const saga_source_view *view,
                     uint32_t index)
{
    saga_source_view r = { .name = "" };
    saga_camera c;
    match m = { .rig = (int)index };

    if (saga_rig(&c, &m.number, film->bytes, film->nbytes, index))
        return (match){ .rig = -1 };
    saga_source_view_of_camera(&r, &film->metric, &c);
    m.distance = distance_between(&r, view);
    m.degrees = turn_between(&r, view);
    /* Focal lengths are relative to the picture's width, so that a scaled
     * capture still has the same cameras. */
    m.focal = fabs(view->fx / view->width * r.width / r.fx - 1.0);
    return m;
}

static match nearest(const saga_film *film, const saga_source_view *view)
{
    match best = { -1, 0, 0.0, 0.0, 0.0 };
    double least = (double)INFINITY;

    for (uint32_t i = 0; i < film->info.n_cameras; i++) {
        const match m = compare(film, view, i);
        /* One distance for place and angle: a cube's width equals a quarter
         * turn. */
        const double far = m.distance / saga_metric_width(&film->metric) +
                           m.degrees / 90.0;

        if (m.rig >= 0 && far < least) {
            least = far;
            best = m;
        }
    }
    return best;
}

static bool is_same(const saga_film *film, const match *m,
                    const tolerance *within)
{
    return m->rig >= 0 && m->degrees <= within->degrees &&
           m->distance <= within->distance * saga_metric_width(&film->metric) &&
           m->focal <= within->focal;
}

/* Finds the rig's camera that has the view's name and could be the view's,
 * refined. The result's rig is -1 if there is none. */
static match namesake(const saga_film *film, const saga_source_view *view)
{
    for (uint32_t i = 0; view->name[0] && i < film->info.n_cameras; i++) {
        const match m = compare(film, view, i);
        saga_naming naming;

        if (is_same(film, &m, &refined) &&
            saga_name_camera(&naming, film->bytes, film->nbytes, m.number) ==
                SAGA_OK &&
            strcmp(naming.name, view->name) == 0)
            return m;
    }
    return (match){ .rig = -1 };
}

static bool refuse_view(const saga_film *film, const saga_source_view *view,
                        const match *m, saga_error *error)
{
    return saga_fail(
        error, film->name,
        "give the capture it was made from, "
        "or name the view in --hold-out",
        "%s is not one of its cameras: the nearest, number "
        "%" PRIu32 ", is %.3g m and %.3g degrees away, its focal length "
        "%.2g %% different",
        view->name, m->number, m->distance, m->degrees, 100.0 * m->focal);
}

/* Takes near plane and background from camera `rig`; without a rig, sets
 * defaults. */
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

/* Makes the views of a capture; sets *ok to false if memory is short. */
static void make_views(saga_eval *eval, bool *ok, const char *name,
                       const saga_capture *capture, saga_error *error)
{
    const int n = capture->n_views;

    *eval = (saga_eval){ .n_views = n, .n_frames = capture->n_frames };
    if (*ok)
        eval->view = saga_calloc((size_t)n, sizeof *eval->view, name, error);
    *ok = *ok && eval->view;
    for (int i = 0; i < n && *ok; i++) {
        const saga_source_view *const view = &capture->views[i];

        eval->view[i] = (saga_eval_view){ .name = view->name,
                                          .width = view->width,
                                          .height = view->height,
                                          .rig = -1,
                                          .late = view->late,
                                          .held_out = view->held_out };
        eval->n_training += !view->held_out;
        eval->n_held_out += view->held_out;
    }
}

/* Gives a view the pose and lens of its camera in the rig, for the size at
 * which its pictures are loaded. The rig's pictures are n times as large, or
 * the loaded ones are. */
static void use_rig(saga_source_view *view, const saga_film *film, int rig)
{
    saga_source_view r = { .name = "" };
    saga_camera c;
    uint32_t number;
    double size;

    if (saga_rig(&c, &number, film->bytes, film->nbytes, (uint32_t)rig))
        return;
    saga_source_view_of_camera(&r, &film->metric, &c);
    size = r.width >= view->width ? 1.0 / rint((double)r.width / view->width)
                                  : rint((double)view->width / r.width);
    memcpy(view->rotation, r.rotation, sizeof view->rotation);
    memcpy(view->translation, r.translation, sizeof view->translation);
    view->fx = size * r.fx;
    view->fy = size * r.fy;
    view->cx = size * r.cx;
    view->cy = size * r.cy;
}

static bool match_view(saga_eval_view *v, const saga_film *film,
                       const saga_source_view *view, saga_error *error)
{
    saga_source_view as_trained = *view;
    match m = namesake(film, view);
    const bool named = m.rig >= 0;
    double near_metres;

    if (named)
        use_rig(&as_trained, film, m.rig);
    else
        m = nearest(film, view);
    /* A held-out view need not be in the rig. A training view must be:
     * otherwise the capture is another one, and its PSNR is meaningless. */
    if (named || is_same(film, &m, &unchanged))
        v->rig = m.rig;
    else if (!view->held_out && film->info.n_cameras)
        return refuse_view(film, view, &m, error);
    borrow(v, &near_metres, film, v->rig < 0 ? 0 : v->rig);
    return saga_camera_of_source_view(&v->camera, &film->metric, &as_trained,
                                      near_metres, error);
}

bool saga_eval_match(saga_eval *eval, const saga_film *film,
                     const saga_capture *capture, int first_frame,
                     saga_error *error)
{
    bool ok = check_time(film, capture, first_frame, error);

    make_views(eval, &ok, film->name, capture, error);
    eval->first_frame = first_frame < 0 ? 0 : first_frame;
    for (int i = 0; i < capture->n_views && ok; i++)
        ok = match_view(&eval->view[i], film, &capture->views[i], error);
    if (!ok)
        saga_eval_free(eval);
    return ok;
}

static bool match_pictures_of(const char *name, const saga_source_view *made,
                              const saga_source_view *view, saga_error *error)
{
    if (strcmp(made->name, view->name) == 0 && made->width == view->width &&
        made->height == view->height)
        return true;
    return saga_fail(error, name, "give pictures of the same capture",
                     "has %s of %d x %d where the capture has %s of %d x %d",
                     made->name, made->width, made->height, view->name,
                     view->width, view->height);
}

bool saga_eval_match_pictures(saga_eval *eval, const char *name,
                              const saga_capture *pictures,
                              const saga_capture *capture, saga_error *error)
{
    const int n = capture->n_views;
    bool ok =
        (pictures->n_views == n && pictures->n_frames == capture->n_frames) ||
        saga_fail(error, name, "give pictures of the same capture",
                  "has %d views of %d frames, the capture %d of %d",
                  pictures->n_views, pictures->n_frames, n, capture->n_frames);

    make_views(eval, &ok, name, capture, error);
    for (int i = 0; i < n && ok; i++)
        ok = match_pictures_of(name, &pictures->views[i], &capture->views[i],
                               error);
    if (!ok)
        saga_eval_free(eval);
    return ok;
}
