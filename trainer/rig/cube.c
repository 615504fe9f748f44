/* SPDX-License-Identifier: MIT
 *
 * Finds where the scene is. Each view gets a range of depths: what the capture
 * says, else what its points say, else what the crossing of the optical axes
 * suggests. The cube then holds what two views see within their ranges, as far
 * as a coarse grid of samples tells, and the points that pictures show, but
 * for the outermost ones.
 */
#include "cube.h"

#include "alloc.h"
#include "camera.h"

#include <math.h>
#include <stdlib.h>

enum {
    GRID = 9,             /* pixels a side that a frustum is sampled at */
    LAYERS = 6,           /* depths, even in 1 / depth */
    MIN_POINTS = 12       /* in a view, to believe them */
};

/* Cameras are at one place where they differ by less than this part of their
 * distance from the origin, which rounding alone makes of it. */
#define ONE_PLACE 1e-9

/* The points' depths get this slack, for what they miss on either side. */
#define NEAR_SLACK 0.6
#define FAR_SLACK 1.5

static int compare(const void *a, const void *b)
{
    const double x = *(const double *)a, y = *(const double *)b;

    return (x > y) - (x < y);
}

static double quantile(double *x, size_t n, double q)
{
    qsort(x, n, sizeof *x, compare);
    return x[(size_t)(q * (double)(n - 1) + 0.5)];
}

static bool inside(const saga_shot *v, const double *uv)
{
    return uv[0] >= 0 && uv[1] >= 0 && uv[0] < v->width && uv[1] < v->height;
}

/* Solves the symmetric positive a x = b in place (Gauss, no pivoting). */
static void solve3(double a[3][3], double *b)
{
    for (int i = 0; i < 3; i++)
        for (int j = i + 1; j < 3; j++) {
            /* Eliminate column i from the rows below it. */
            const double q = a[j][i] / a[i][i];

            for (int k = i; k < 3; k++)
                a[j][k] -= q * a[i][k];
            b[j] -= q * b[i];
        }
    for (int i = 2; i >= 0; i--) {
        /* Back, from the last unknown to the first. */
        for (int k = i + 1; k < 3; k++)
            b[i] -= a[i][k] * b[k];
        b[i] /= a[i][i];
    }
}

static double length(const double *x)
{
    return sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2]);
}

/* Mean of the camera centres, and their distance from it. */
static double baseline(double *mean, const saga_capture *c)
{
    double sum = 0;

    mean[0] = mean[1] = mean[2] = 0;
    for (int v = 0; v < c->n_views; v++) {
        double x[3];

        saga_shot_centre(x, c->views + v);
        for (int i = 0; i < 3; i++)
            mean[i] += x[i] / c->n_views;
    }
    for (int v = 0; v < c->n_views; v++) {
        double x[3];

        saga_shot_centre(x, c->views + v);
        for (int i = 0; i < 3; i++)
            sum += (x[i] - mean[i]) * (x[i] - mean[i]) / c->n_views;
    }
    return sqrt(sum);
}

/* Finds the point nearest to all optical axes. Parallel axes leave it open
 * along them: a weak pull towards five baselines before the cameras decides. */
static double focus(double *x, const saga_capture *c)
{
    double mean[3], axis[3] = { 0 }, a[3][3] = { { 0 } };
    double base = baseline(mean, c), norm;

    if (!(base > ONE_PLACE * length(mean)))
        base = 0.2;
    x[0] = x[1] = x[2] = 0;
    for (int v = 0; v < c->n_views; v++) {
        const double *const d = c->views[v].rotation + 6;
        double p[3];

        saga_shot_centre(p, c->views + v);
        for (int i = 0; i < 3; i++) {
            axis[i] += d[i];
            for (int j = 0; j < 3; j++) {
                /* 1 - d d^T takes the part at right angles to the axis: the sum
                 * of its squares over all axes is to be least. */
                const double w = (i == j) - d[i] * d[j];

                a[i][j] += w;
                x[i] += w * p[j];
            }
        }
    }
    norm = length(axis);
    norm = norm > 0 ? norm : 1;
    for (int i = 0; i < 3; i++) {
        /* A thousandth of what the axes weigh. */
        const double pull = 1e-3 * c->n_views;

        a[i][i] += pull;
        x[i] += pull * (mean[i] + 5 * base * axis[i] / norm);
    }
    solve3(a, x);
    return base;
}

/* Takes the range from the points the view sees; false if there are too few. */
static bool range_of_points(double *range, const saga_capture *c, int view,
                            double *scratch)
{
    const saga_shot *const v = c->views + view;
    size_t n = 0;

    for (size_t i = 0; i < c->n_points; i++) {
        double uv[2], z;

        if (saga_view_project(v, c->points[i].position, uv, &z) &&
            inside(v, uv))
            scratch[n++] = z;
    }
    if (n < MIN_POINTS)
        return false;
    /* Two points in a hundred may be wrong at either end. */
    range[0] = NEAR_SLACK * quantile(scratch, n, 0.02);
    range[1] = FAR_SLACK * quantile(scratch, n, 0.98);
    return range[1] > range[0];
}

static void range_of_focus(double *range, const saga_shot *v, const double *x,
                           double base)
{
    double p[3];
    double z;

    saga_view_transform(v, x, p);
    /* Not nearer than a baseline, also where the focus is behind the view. */
    z = p[2] > base ? p[2] : base;
    range[0] = 0.3 * z;
    range[1] = 4 * z;
}

static void find_ranges(double *range, const saga_capture *c, double *scratch)
{
    double x[3];
    const double base = focus(x, c);

    for (int v = 0; v < c->n_views; v++) {
        const saga_shot *const w = c->views + v;
        double *const r = range + 2 * (size_t)v;

        /* The capture's own word comes first, with a little slack; then
         * points, then the focus. */
        if (w->near_depth > 0 && w->far_depth > w->near_depth) {
            r[0] = 0.9 * w->near_depth;
            r[1] = 1.05 * w->far_depth;
        } else if (!range_of_points(r, c, v, scratch)) {
            range_of_focus(r, w, x, base);
        }
    }
}

/* Counts training views that have the place within picture and range. */
static int n_seeing(const saga_capture *c, const double *range,
                    const double *world)
{
    int n = 0;

    for (int v = 0; v < c->n_views; v++) {
        double uv[2], z;

        /* Samples lie on the ends of their own view's range: 1 % of slack, so
         * that rounding does not lose them. */
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

static void sample_world(double *x, const saga_shot *v, const double *range,
                         int i)
{
    const double uv[2] = { (i % GRID) * v->width / (GRID - 1.0),
                           (i / GRID % GRID) * v->height / (GRID - 1.0) };
    const double k = (i / GRID / GRID) / (LAYERS - 1.0);

    saga_view_lift(v, uv, 1 / (1 / range[0] +
                               k * (1 / range[1] - 1 / range[0])), x);
}

/* Returns false if no two views share anything. */
static bool include_frusta(double lo[3], double hi[3], const saga_capture *c,
                           const double *range, int n_needed)
{
    bool any = false;

    for (int v = 0; v < c->n_views; v++) {
        if (c->views[v].held_out)
            continue;
        /* Samples of this view that enough training views see, this one
         * counted. */
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

/* Takes in the points that a picture shows: others would make the cube large
 * for nothing. */
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
        a[i] = quantile(scratch, n, 0.01);
        b[i] = quantile(scratch, n, 0.99);
    }
    include(lo, hi, a);
    include(lo, hi, b);
}

bool saga_cube_fit(saga_cube *cube, double *range, const saga_capture *c,
                   saga_error *error)
{
    double lo[3] = { INFINITY, INFINITY, INFINITY };
    double hi[3] = { -INFINITY, -INFINITY, -INFINITY };
    double *const scratch = saga_alloc(c->n_points, sizeof *scratch,
                                       "the capture's points", error);

    if (!scratch)
        return false;
    find_ranges(range, c, scratch);
    /* Two views that see the same give it a depth that can be learned; only
     * where no two share anything is it all that any of them sees. */
    if (!include_frusta(lo, hi, c, range, 2))
        include_frusta(lo, hi, c, range, 1);
    include_points(lo, hi, c, scratch);
    cube->unit = 0;
    for (int i = 0; i < 3; i++) {
        cube->centre[i] = (lo[i] + hi[i]) / 2;
        if ((hi[i] - lo[i]) / 2 > cube->unit)
            cube->unit = (hi[i] - lo[i]) / 2;
    }
    /* A cube: half of its longest side, and 2 % so that
     * nothing is on its border. */
    cube->unit *= 1.02;
    if (!(cube->unit > 0 && cube->unit < INFINITY))
        cube->unit = 1;
    free(scratch);
    return true;
}
