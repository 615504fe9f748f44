/* SPDX-License-Identifier: MIT */
#include "orbit.h"

#include "alloc.h"
#include "error.h"
#include "order.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double pi = 3.14159265358979323846;

/* --- Where the rig looks ------------------------------------------------- */

/* Solves the symmetric positive definite m x = v by Cramer's rule. */
static void solve(double x[3], const double m[9], const double v[3])
{
    double c[3][3], d;

    /* The columns of the inverse are the cross products of m's rows, divided by
     * the determinant; as the inverse is symmetric, so are its rows. */
    cross3(c[0], m + 3, m + 6);
    cross3(c[1], m + 6, m);
    cross3(c[2], m, m + 3);
    d = dot3(m, c[0]);
    for (int i = 0; i < 3; i++)
        x[i] = (c[0][i] * v[0] + c[1][i] * v[1] + c[2][i] * v[2]) / d;
}

/* Finds the point nearest to all optical axes. A weak pull to the middle of the
 * cube determines it if the axes are parallel. */
static void find_focus(double focus[3], const saga_metric *metric,
                       const saga_source_view *views, int n)
{
    double m[9] = { 0.0 }, v[3] = { 0.0 };

    for (int s = 0; s < n; s++) {
        const double *const f = views[s].rotation + 6;
        double centre[3];

        saga_source_view_centre(centre, &views[s]);
        for (int i = 0; i < 3; i++)
            for (int k = 0; k < 3; k++) {
                /* 1 - f f^T projects a vector to the plane perpendicular to the
                 * axis f. The point minimises the sum over axes of the squared
                 * length of that part. */
                const double p = (i == k ? 1.0 : 0.0) - f[i] * f[k];

                m[3 * i + k] += p;
                v[i] += p * centre[k];
            }
    }
    for (int i = 0; i < 3; i++) {
        /* Add the pull to the cube's middle, a thousandth as strong as the axes
         * together: it makes m invertible for any axes. */
        m[4 * i] += 1e-3 * n;
        v[i] += 1e-3 * n * metric->centre[i];
    }
    solve(focus, m, v);
}

/* --- The sweep ----------------------------------------------------------- */

/* Sets the mean of the cameras' up vectors or, if they cancel out, the first
 * camera's. */
static void mean_up(double up[3], const saga_source_view *views, int n)
{
    for (int i = 0; i < 3; i++) {
        up[i] = 0.0;
        for (int s = 0; s < n; s++)
            up[i] -= views[s].rotation[3 + i];
    }
    if (!normalise3(up))
        for (int i = 0; i < 3; i++)
            up[i] = -views[0].rotation[3 + i];
}

/* People hold cameras level, whatever the tilt, so up is the direction most
 * nearly perpendicular to all horizontal axes r of the cameras. It is found by
 * power iteration on the matrix 1 - mean of r r^T, which begins with the mean
 * up; that start decides if all axes agree. */
void saga_views_up(double up[3], const saga_source_view *views, int n)
{
    enum { STEPS = 64 };

    mean_up(up, views, n);
    for (int step = 0; step < STEPS; step++) {
        /* next = up - mean of r (r . up) */
        double next[3] = { up[0], up[1], up[2] };

        for (int s = 0; s < n; s++)
            for (int i = 0; i < 3; i++)
                next[i] -= views[s].rotation[i] * dot3(views[s].rotation, up) /
                           n;
        /* If all horizontal axes are along up, nothing is left: keep up. */
        if (!normalise3(next))
            return;
        memcpy(up, next, sizeof next);
    }
}

/* Splits a vector into its height along up, which is returned, and the rest,
 * which stays in it. */
static double level_off(double a[3], const double up[3])
{
    const double height = dot3(a, up);

    for (int i = 0; i < 3; i++)
        a[i] -= height * up[i];
    return height;
}

/* Splits a camera's position relative to the focus: returns the height along
 * up, and sets `level` to the rest. */
static double split(double level[3], const saga_orbit *o,
                    const saga_source_view *view)
{
    saga_source_view_centre(level, view);
    for (int i = 0; i < 3; i++)
        level[i] -= o->focus[i];
    return level_off(level, o->up);
}

/* Sets axes, radius and height of the orbit. */
static bool find_middle(saga_orbit *o, const saga_source_view *views, int n)
{
    double level[3];

    o->radius = o->height = 0.0;
    for (int i = 0; i < 3; i++)
        o->ahead[i] = 0.0;
    for (int s = 0; s < n; s++) {
        o->height += split(level, o, &views[s]) / n;
        o->radius += sqrt(dot3(level, level)) / n;
        for (int i = 0; i < 3; i++)
            o->ahead[i] += level[i];
    }
    /* If the cameras stand all round, their directions cancel out, and the
     * first camera's direction is used as ahead. */
    if (!normalise3(o->ahead)) {
        split(o->ahead, o, &views[0]);
        if (!normalise3(o->ahead))
            return false;
    }
    cross3(o->side, o->up, o->ahead);
    return true;
}

/* Finds the range of the cameras' angles: the full circle without the widest
 * gap between two neighbours. */
static void find_sweep(saga_orbit *o, const saga_source_view *views, int n,
                       double *angle)
{
    double gap, end;

    for (int s = 0; s < n; s++) {
        double level[3];

        split(level, o, &views[s]);
        angle[s] = atan2(dot3(level, o->side), dot3(level, o->ahead));
    }
    qsort(angle, (size_t)n, sizeof *angle, saga_by_value);
    /* The gap across the seam at -pi and pi is the first candidate. If another
     * gap is wider, the range crosses the seam. */
    gap = angle[0] + 2.0 * pi - angle[n - 1];
    end = angle[n - 1];
    for (int s = 1; s < n; s++)
        if (angle[s] - angle[s - 1] > gap) {
            gap = angle[s] - angle[s - 1];
            end = angle[s - 1] + 2.0 * pi;
        }
    o->half = 0.5 * (2.0 * pi - gap);
    o->middle = end - o->half;
    /* A rig that leaves out less than a quarter turn counts as all round. */
    o->closed = gap < pi / 2.0;
    if (n == 1)
        o->half = pi / 36.0; /* a single camera: a glance to the side still
                              * shows depth */
}

bool saga_orbit_of(saga_orbit *orbit, const saga_film *film, saga_error *error)
{
    const int n = (int)film->info.n_cameras;
    saga_source_view *const views = saga_calloc((size_t)n, sizeof *views,
                                                film->name, error);
    double *const angle = saga_calloc((size_t)n, sizeof *angle, film->name,
                                      error);
    uint32_t number;
    bool ok = views && angle &&
              saga_film_rig(film, 0, &orbit->lens, &number, error);

    /* The cameras of the rig, in metres. */
    for (int i = 0; i < n && ok; i++) {
        saga_camera c;

        ok = saga_film_rig(film, (uint32_t)i, &c, &number, error);
        saga_source_view_of_camera(&views[i], &film->metric, &c);
    }
    /* Find what they look at, which way is up, and the arc that they span. */
    if (ok) {
        find_focus(orbit->focus, &film->metric, views, n);
        saga_views_up(orbit->up, views, n);
        ok = find_middle(orbit, views, n);
    }
    if (ok)
        find_sweep(orbit, views, n, angle);
    else
        saga_fail(error, film->name, "give a camera",
                  "its cameras do not determine a path");
    free(views);
    free(angle);
    return ok;
}

void saga_orbit_keep_inside(saga_orbit *o, const saga_volume *volume,
                            const saga_metric *metric)
{
    const double turn = pi / 32768;
    const double azimuth = volume->azimuth * turn;
    /* From straight above or below, no direction of the picture is up. */
    const double steepest = 0.499 * pi;
    double eye[3], elevation, distance;

    /* Take the rig's middle as seen from the pivot, and axes of the volume. */
    for (int i = 0; i < 3; i++) {
        const double pivot = metric->centre[i] +
                             metric->unit * volume->pivot[i];

        eye[i] = o->focus[i] +
                 o->radius * (cos(o->middle) * o->ahead[i] +
                              sin(o->middle) * o->side[i]) +
                 o->height * o->up[i] - pivot;
        o->focus[i] = pivot;
        o->up[i] = volume->up[i];
        o->ahead[i] = volume->front[i];
    }
    normalise3(o->up);
    level_off(o->ahead, o->up);
    normalise3(o->ahead);
    cross3(o->side, o->up, o->ahead);
    o->height = level_off(eye, o->up);
    o->radius = sqrt(dot3(eye, eye));
    o->middle = atan2(dot3(eye, o->side), dot3(eye, o->ahead));

    /* Bring middle, sweep, elevation and distance into its ranges. A full
     * circle becomes a swing about the front. */
    if (volume->azimuth < 32768) {
        o->half = o->closed ? azimuth : fmin(o->half, azimuth);
        o->closed = false;
        o->middle = fmin(fmax(o->middle, o->half - azimuth), azimuth - o->half);
    }
    elevation = fmin(
        fmax(atan2(o->height, o->radius), volume->elevation_min * turn),
        volume->elevation_max * turn);
    elevation = fmin(fmax(elevation, -steepest), steepest);
    distance = fmin(
        fmax(hypot(o->height, o->radius), metric->unit * volume->distance_min),
        metric->unit * volume->distance_max);
    o->radius = distance * cos(elevation);
    o->height = distance * sin(elevation);
}

bool saga_orbit_camera(saga_camera *camera, const saga_orbit *orbit,
                       const saga_metric *metric, double turn,
                       saga_error *error)
{
    const double phase = 2.0 * pi * turn;
    /* If the orbit is no full circle, the camera swings, and is slowest where
     * it turns back. */
    const double angle = orbit->middle +
                         (orbit->closed ? phase : orbit->half * sin(phase));
    double centre[3], *right, *down, *forward;
    saga_source_view view = { .name = "orbit" };

    saga_source_view_of_camera(&view, metric, &orbit->lens);
    right = view.rotation;
    down = view.rotation + 3;
    forward = view.rotation + 6;
    for (int i = 0; i < 3; i++) {
        /* The camera stands at the orbit's radius and height, and looks at the
         * focus. */
        const double away = cos(angle) * orbit->ahead[i] +
                            sin(angle) * orbit->side[i];

        forward[i] = -orbit->radius * away - orbit->height * orbit->up[i];
        centre[i] = orbit->focus[i] - forward[i];
    }
    cross3(right, forward, orbit->up);
    if (!normalise3(forward) || !normalise3(right))
        return saga_fail(error, "orbit", "give a camera",
                         "its cameras look straight down");
    cross3(down, forward, right);
    for (int i = 0; i < 3; i++)
        view.translation[i] = -dot3(view.rotation + 3 * i, centre);
    *camera = orbit->lens;
    return saga_camera_of_source_view(
        camera, metric, &view, metric->unit * orbit->lens.near_plane, error);
}

void saga_orbit_time(uint32_t *num, uint32_t *den, uint32_t n_frames, int i,
                     int n)
{
    const uint32_t most = UINT32_MAX / n_frames, pictures = (uint32_t)n;

    /* n_frames * den < 2^32, so that its product with i is below 2^63. */
    *den = pictures < most ? pictures : most;
    *num = (uint32_t)((uint64_t)n_frames * *den * (uint32_t)i / pictures);
}

void saga_camera_resize(saga_camera *camera, int width, int height)
{
    const double sx = (double)width / camera->width;
    const double sy = (double)height / camera->height;
    const double scale = sx < sy ? sx : sy;
    const int old[2] = { camera->width, camera->height };
    const int side[2] = { width, height };

    for (int i = 0; i < 2; i++) {
        /* Offset of the principal point from the middle of the picture, where
         * 32768 is half a pixel in Q16. */
        const double off = camera->principal_q16[i] - 32768.0 * old[i];
        const double focal = rint(scale * camera->focal_q16[i]);
        const double at = rint(32768.0 * side[i] + scale * off);

        camera->focal_q16[i] = (int32_t)fmin(fmax(focal, 1.0), 2147483647.0);
        camera->principal_q16[i] = (int32_t)fmin(fmax(at, -1073741824.0),
                                                 1073741824.0);
    }
    camera->width = (uint16_t)width;
    camera->height = (uint16_t)height;
}

void saga_camera_fit(saga_camera *camera, int side)
{
    const int w = camera->width, h = camera->height;
    const double scale = (double)side / (w > h ? w : h);

    saga_camera_resize(camera, (int)fmax(rint(scale * w), 1),
                       (int)fmax(rint(scale * h), 1));
}
