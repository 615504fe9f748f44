/* SPDX-License-Identifier: MIT */
#include "check.h"

#include "error.h"
#include "notes.h"
#include "pose.h"

#include <math.h>
#include <string.h>

enum { FEW_POINTS = 8 };

/* Tells whether a view sees a point. flip = -1 negates the camera's y and z
 * axes, 1 leaves them. */
static bool sees(const saga_source_view *view, const double world[3],
                 double flip, double *depth)
{
    double c[3];
    saga_view_transform(view, world, c);
    /* With negated axes the point's coordinates are (x, -y, -z). */
    *depth = flip * c[2];
    if (!(*depth > 0.0))
        return false;
    const double u = view->fx * c[0] / *depth + view->cx;
    const double v = view->fy * flip * c[1] / *depth + view->cy;
    return u >= 0.0 && v >= 0.0 && u < view->width && v < view->height;
}

/* Returns the fraction of the points that a view sees. There must be at least
 * one point. */
static double share_seen(const saga_capture *capture, int view)
{
    size_t n = 0;
    double depth;
    for (size_t i = 0; i < capture->n_points; i++)
        n += sees(&capture->views[view], capture->points[i].position, 1.0,
                  &depth);
    return (double)n / (double)capture->n_points;
}

/* Counts the points that at least two views see. */
static size_t count_shared(const saga_capture *capture, double flip)
{
    size_t n_shared = 0;
    for (size_t i = 0; i < capture->n_points; i++) {
        int n = 0;
        double z;
        for (int v = 0; v < capture->n_views && n < 2; v++)
            n += sees(&capture->views[v], capture->points[i].position, flip,
                      &z);
        n_shared += n == 2;
    }
    return n_shared;
}

bool saga_check_hands(const saga_listing *listing, saga_error *told,
                      saga_error *error)
{
    const saga_source *odd = NULL;
    int n = 0;
    for (int v = 0; v < listing->n_sources; v++)
        if (saga_pose_is_mirrored(listing->sources[v].rotation)) {
            odd = odd ? odd : &listing->sources[v];
            n++;
        }
    if (n == 0)
        return true;
    /* Of a mixture no single correction is right. */
    const bool mixed = n < listing->n_sources;
    saga_fail(mixed || !told ? error : told, listing->path,
              mixed ? "export all poses again, with right-handed axes"
                    : "export them with right-handed axes, since a left-handed "
                      "program wrote them; `saga check` finds by the pictures "
                      "which axis is reversed, and --fix writes correct "
                      "cameras",
              "the poses of %d of %d cameras, among them %s, are mirror "
              "images (determinant -1)",
              n, listing->n_sources, odd->name);
    return !mixed && told;
}

static bool overlap_by_points(saga_capture *capture, const char *path,
                              saga_error *error)
{
    const size_t n = capture->n_points;
    const size_t shared = count_shared(capture, 1.0);
    /* Only nonsensical poses should be refused, so a hundredth of the points
     * and at least four are enough. */
    if (shared >= FEW_POINTS / 2 && shared >= n / 100)
        return true;
    /* If the poses are in OpenGL's axes, the scene is behind the cameras, which
     * see most points once their axes are negated. */
    const bool flipped = count_shared(capture, -1.0) > n / 2;
    return saga_fail(
        error, path,
        flipped ? "correct their axes, which look like the other "
                  "convention: negate columns 1 and 2 of the "
                  "camera-to-world matrices"
                : "check the poses, their axis convention and that the "
                  "points are in the same world",
        "no overlap: only %zu of %zu points lie in front of and "
        "inside two or more of the %d cameras",
        shared, n, capture->n_views);
}

static double rig_size(const saga_capture *capture)
{
    double first[3] = { 0 }, size = 0.0;
    for (int v = 0; v < capture->n_views; v++) {
        double c[3], d2 = 0.0;
        saga_pose_centre(capture->views[v].rotation,
                         capture->views[v].translation, c);
        if (v == 0)
            memcpy(first, c, sizeof first);
        for (int i = 0; i < 3; i++)
            d2 += (c[i] - first[i]) * (c[i] - first[i]);
        size = fmax(size, sqrt(d2));
    }
    /* If all cameras stand at one place, 1 replaces the size. */
    return size > 0.0 ? size : 1.0;
}

/* Tells whether b sees any of the points that a may see at depths of 1/4 to 16
 * times the size of the rig. */
static bool frusta_meet(const saga_source_view *a, const saga_source_view *b,
                        double size)
{
    /* Seven depths, each twice the last, and at each depth 5 x 5 rays through
     * the centres of equal boxes in a's picture. */
    for (double z = 0.25 * size; z <= 16.0 * size; z *= 2.0)
        for (int i = 0; i < 25; i++) {
            const double uv[2] = { a->width * (i % 5 + 0.5) / 5,
                                   a->height * (i / 5 + 0.5) / 5 };
            double world[3], depth;
            saga_view_lift(a, uv, z, world);
            if (sees(b, world, 1.0, &depth))
                return true;
        }
    return false;
}

static bool overlap_by_frusta(const saga_capture *capture, const char *path,
                              saga_error *error)
{
    const double size = rig_size(capture);
    for (int a = 0; a < capture->n_views; a++)
        for (int b = 0; b < capture->n_views; b++)
            if (a != b &&
                frusta_meet(&capture->views[a], &capture->views[b], size))
                return true;
    return saga_fail(error, path, "check the poses and their axis convention",
                     "no overlap: no two of the %d cameras look at anything "
                     "in common",
                     capture->n_views);
}

bool saga_check_overlap(saga_capture *capture, const char *path,
                        saga_error *error)
{
    static const saga_note_kind away = {
        "warning: hardly any points are in view, as of cameras that look "
        "away: ",
        ""
    };
    if (capture->n_points >= FEW_POINTS)
        for (int v = 0; v < capture->n_views; v++) {
            const double share = share_seen(capture, v);
            if (share < 0.01)
                saga_note_each(capture->notes, &away, "%s sees %.1f %%",
                               capture->views[v].name, 100.0 * share);
        }
    if (capture->n_views < 2)
        return true;
    return capture->n_points >= FEW_POINTS
               ? overlap_by_points(capture, path, error)
               : overlap_by_frusta(capture, path, error);
}
