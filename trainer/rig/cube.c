/* SPDX-License-Identifier: MIT
 *
 * Finds the cube of the scene. Each view gets a range of depths: the one in the
 * capture, or from points that it sees, or from the crossing of the optical
 * axes. The cube then contains everything that at least two views see within
 * their ranges, on a coarse grid of samples, and the points that pictures show,
 * without outliers. Of a subject it is then cropped to the box that is given or
 * that the masks determine, and so are the ranges.
 */
#include "cube.h"

#include "alloc.h"
#include "camera.h"
#include "hull.h"
#include "order.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    GRID = 9,       /* samples per side of a view's picture */
    LAYERS = 6,     /* sampled depths, even in 1 / depth */
    MIN_POINTS = 12 /* least points in a view for a range of depths */
};

/* Cameras are at one place if they differ by less than this part of their
 * distance from the origin, which may be rounding error. */
#define ONE_PLACE 1e-9

/* The range of the points' depths is widened by these factors, for what the
 * points miss. */
#define NEAR_SLACK 0.6
#define FAR_SLACK 1.5

static bool inside(const saga_source_view *v, const double *uv)
{
    return uv[0] >= 0 && uv[1] >= 0 && uv[0] < v->width && uv[1] < v->height;
}

/* Solves a x = b for symmetric positive definite a, in place (Gauss, without
 * pivoting). */
static void solve3(double a[3][3], double *b)
{
    for (int i = 0; i < 3; i++)
        for (int j = i + 1; j < 3; j++) {
            /* Eliminates column i from the rows below. */
            const double q = a[j][i] / a[i][i];

            for (int k = i; k < 3; k++)
                a[j][k] -= q * a[i][k];
            b[j] -= q * b[i];
        }
    for (int i = 2; i >= 0; i--) {
        /* Back substitution. */
        for (int k = i + 1; k < 3; k++)
            b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
}

/* Sets mean to the mean of the camera centres. Returns their RMS distance from
 * it. */
static double baseline(double *mean, const saga_capture *c)
{
    double sum = 0;

    mean[0] = mean[1] = mean[2] = 0;
    for (int v = 0; v < c->n_views; v++) {
        double x[3];

        saga_source_view_centre(x, c->views + v);
        for (int i = 0; i < 3; i++)
            mean[i] += x[i] / c->n_views;
    }
    for (int v = 0; v < c->n_views; v++) {
        double x[3];

        saga_source_view_centre(x, c->views + v);
        for (int i = 0; i < 3; i++)
            sum += (x[i] - mean[i]) * (x[i] - mean[i]) / c->n_views;
    }
    return sqrt(sum);
}

/* Finds the point nearest to all optical axes. If the axes are parallel, their
 * sum leaves it undetermined along them; then a weak pull to five baselines in
 * front of the cameras decides. Returns the baseline. */
static double focus(double *x, const saga_capture *c)
{
    double mean[3], axis[3] = { 0 }, a[3][3] = { { 0 } };
    double base = baseline(mean, c), norm;

    if (!(base > ONE_PLACE * length3(mean)))
        base = 0.2;
    x[0] = x[1] = x[2] = 0;
    for (int v = 0; v < c->n_views; v++) {
        const double *const d = c->views[v].rotation + 6;
        double p[3];

        saga_source_view_centre(p, c->views + v);
        for (int i = 0; i < 3; i++) {
            axis[i] += d[i];
            for (int j = 0; j < 3; j++) {
                /* 1 - d d^T projects perpendicular to the axis. The sum of
                 * these squared distances over all axes is minimised. */
                const double w = (i == j) - d[i] * d[j];

                a[i][j] += w;
                x[i] += w * p[j];
            }
        }
    }
    norm = length3(axis);
    norm = norm > 0 ? norm : 1;
    for (int i = 0; i < 3; i++) {
        /* The pull has a thousandth of the weight of the axes. */
        const double pull = 1e-3 * c->n_views;

        a[i][i] += pull;
        x[i] += pull * (mean[i] + 5 * base * axis[i] / norm);
    }
    solve3(a, x);
    return base;
}

/* Sets the range from the points that the view sees. Returns false if they are
 * too few. */
static bool range_of_points(double *range, const saga_capture *c, int view,
                            double *scratch)
{
    const saga_source_view *const v = c->views + view;
    size_t n = 0;

    for (size_t i = 0; i < c->n_points; i++) {
        double uv[2], z;

        if (saga_view_project(v, c->points[i].position, uv, &z) &&
            inside(v, uv))
            scratch[n++] = z;
    }
    if (n < MIN_POINTS)
        return false;
    /* Two percent of the points at either end are ignored as outliers. */
    range[0] = NEAR_SLACK * saga_quantile(scratch, n, 0.02);
    range[1] = FAR_SLACK * saga_quantile(scratch, n, 0.98);
    return range[1] > range[0];
}

static void range_of_focus(double *range, const saga_source_view *v,
                           const double *x, double base)
{
    double p[3];
    double z;

    saga_view_transform(v, x, p);
    /* The depth is at least a baseline, even if the focus is behind the
     * view. */
    z = p[2] > base ? p[2] : base;
    range[0] = 0.3 * z;
    range[1] = 4 * z;
}

static void find_ranges(double *range, const saga_capture *c, double *scratch)
{
    double x[3];
    const double base = focus(x, c);

    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const w = c->views + v;
        double *const r = range + 2 * (size_t)v;

        /* The range in the capture comes first, with a little slack, then
         * points, then the focus. */
        if (w->near_depth > 0 && w->far_depth > w->near_depth) {
            r[0] = 0.9 * w->near_depth;
            r[1] = 1.05 * w->far_depth;
        } else if (!range_of_points(r, c, v, scratch)) {
            range_of_focus(r, w, x, base);
        }
    }
}

/* Returns the number of training views that see the place in their picture and
 * range of depths. */
static int n_seeing(const saga_capture *c, const double *range,
                    const double *world)
{
    int n = 0;

    for (int v = 0; v < c->n_views; v++) {
        double uv[2], z;

        /* Samples are at the ends of their own view's range. 1 % of slack keeps
         * them in spite of rounding. */
        if (!c->views[v].held_out &&
            saga_view_project(c->views + v, world, uv, &z) &&
            inside(c->views + v, uv) && z >= 0.99 * range[2 * v] &&
            z <= 1.01 * range[2 * v + 1])
            n++;
    }
    return n;
}

static void include(double lo[3], double hi[3], const double *x)
{
    for (int i = 0; i < 3; i++) {
        lo[i] = x[i] < lo[i] ? x[i] : lo[i];
        hi[i] = x[i] > hi[i] ? x[i] : hi[i];
    }
}

static void sample_world(double *x, const saga_source_view *v,
                         const double *range, int i)
{
    const double uv[2] = { (i % GRID) * v->width / (GRID - 1.0),
                           (i / GRID % GRID) * v->height / (GRID - 1.0) };
    const double k = (i / GRID / GRID) / (LAYERS - 1.0);

    saga_view_lift(v, uv,
                   1 / (1 / range[0] + k * (1 / range[1] - 1 / range[0])), x);
}

/* Extends lo..hi by the samples that at least n_needed training views see.
 * Returns false if there are none. */
static bool include_frusta(double lo[3], double hi[3], const saga_capture *c,
                           const double *range, int n_needed)
{
    bool any = false;

    for (int v = 0; v < c->n_views; v++) {
        if (c->views[v].held_out)
            continue;
        /* The view itself counts as one of those that see its sample. */
        for (int i = 0; i < GRID * GRID * LAYERS; i++) {
            double x[3];

            sample_world(x, c->views + v, range + 2 * v, i);
            if (n_seeing(c, range, x) < n_needed)
                continue;
            include(lo, hi, x);
            any = true;
        }
    }
    return any;
}

/* Tells whether a training view has the place in its picture. */
static bool is_seen(const saga_capture *c, const double *world)
{
    double uv[2], z;

    for (int v = 0; v < c->n_views; v++)
        if (!c->views[v].held_out &&
            saga_view_project(c->views + v, world, uv, &z) &&
            inside(c->views + v, uv))
            return true;
    return false;
}

/* Extends lo..hi by the points that a picture shows. Others would make the cube
 * larger without use. */
static void include_points(double lo[3], double hi[3], const saga_capture *c,
                           double *scratch)
{
    double a[3], b[3];

    for (int i = 0; i < 3; i++) {
        size_t n = 0;

        for (size_t k = 0; k < c->n_points; k++)
            if (is_seen(c, c->points[k].position))
                scratch[n++] = c->points[k].position[i];
        if (n < MIN_POINTS)
            return;
        a[i] = saga_quantile(scratch, n, 0.01);
        b[i] = saga_quantile(scratch, n, 0.99);
    }
    include(lo, hi, a);
    include(lo, hi, b);
}

/* Sets the ranges of depths to those of the box's corners. The nearest is at
 * least a fiftieth of the farthest, for cameras inside the box. */
static void crop_ranges(double *range, const saga_capture *c,
                        const double lo[3], const double hi[3])
{
    for (int v = 0; v < c->n_views; v++) {
        double near = INFINITY, far = 0;

        for (int i = 0; i < 8; i++) {
            const double corner[3] = { i & 1 ? hi[0] : lo[0],
                                       i & 2 ? hi[1] : lo[1],
                                       i & 4 ? hi[2] : lo[2] };
            double cam[3];

            saga_view_transform(c->views + v, corner, cam);
            near = fmin(near, cam[2]);
            far = fmax(far, cam[2]);
        }
        /* A camera that looks away keeps its range. */
        if (!(far > 0))
            continue;
        range[2 * v] = fmax(near, far / 50);
        range[2 * v + 1] = far;
    }
}

/* Crops lo..hi and the ranges to the subject. */
static bool crop(double lo[3], double hi[3], double *range,
                 const saga_capture *c, saga_error *error)
{
    if (c->box[0] < c->box[3]) {
        memcpy(lo, c->box, 3 * sizeof *lo);
        memcpy(hi, c->box + 3, 3 * sizeof *hi);
    } else if (!saga_hull_box(lo, hi, c, error)) {
        return false;
    }
    crop_ranges(range, c, lo, hi);
    return true;
}

/* Finds the box lo..hi of the scene or the subject, and the ranges. */
static bool find_box(double lo[3], double hi[3], double *range,
                     const saga_capture *c, saga_error *error)
{
    double *const scratch = saga_alloc(c->n_points, sizeof *scratch,
                                       "the capture's points", error);

    if (!scratch)
        return false;
    for (int i = 0; i < 3; i++) {
        lo[i] = INFINITY;
        hi[i] = -INFINITY;
    }
    find_ranges(range, c, scratch);
    /* A place that two views see has a depth that can be learned. If no two
     * views share anything, the cube contains what any view sees. */
    if (!include_frusta(lo, hi, c, range, 2))
        include_frusta(lo, hi, c, range, 1);
    include_points(lo, hi, c, scratch);
    free(scratch);
    return !c->subject || crop(lo, hi, range, c, error);
}

bool saga_cube_subject(double box[6], const saga_capture *c, saga_error *error)
{
    double *const range = saga_calloc(2 * (size_t)c->n_views, sizeof *range,
                                      "the views", error);
    const bool ok = range && find_box(box, box + 3, range, c, error);

    free(range);
    return ok;
}

bool saga_cube_fit(saga_cube *cube, double *range, const saga_capture *c,
                   saga_error *error)
{
    double lo[3], hi[3];

    if (!find_box(lo, hi, range, c, error))
        return false;
    cube->unit = 0;
    for (int i = 0; i < 3; i++) {
        cube->centre[i] = (lo[i] + hi[i]) / 2;
        if ((hi[i] - lo[i]) / 2 > cube->unit)
            cube->unit = (hi[i] - lo[i]) / 2;
    }
    /* The cube has half of the longest side as its unit, plus 2 % so that
     * nothing is on its border. */
    cube->unit *= 1.02;
    if (!(cube->unit > 0 && cube->unit < INFINITY))
        cube->unit = 1;
    return true;
}
