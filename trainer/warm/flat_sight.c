/* SPDX-License-Identifier: MIT
 *
 * A sight is what a pixel tells about a place in the scene. A plane sweep finds
 * its depth. Whether and when the place changes is then read from its pixels
 * over time.
 */
#include "flat_state.h"

#include "plane_sweep.h"

#include <math.h>
#include <string.h>

enum {
    PATCH = SAGA_PATCH,
    N_WITNESSES = 3 /* views that decide whether a place stands still */
};

/* Largest mean difference of patches that count as equal. */
#define STILL 0.05

/* --- Over time ----------------------------------------------------------- */

/* Tells whether any of n witnesses (the views view[]) still sees at frame g, at
 * its pixel uv[], what it saw in the patch then[]. */
static bool unchanged(const saga_flat *f, const saga_patch *then,
                      const int *view, double (*uv)[2], int n, int g)
{
    for (int k = 0; k < n; k++) {
        saga_patch now;

        if (saga_patch_cut(&now, f->pictures, view[k], g, uv[k][0], uv[k][1]) &&
            saga_patch_distance(then + k, &now) < STILL)
            return true;
    }
    return false;
}

/* Finds the longest interval without change around a frame, and sets the
 * temporal attributes accordingly. A place that looks the same in most frames
 * stands still; whatever passes in front of it for a while belongs to other
 * primitives. */
static void watch(saga_flat_sight *s, const saga_flat *f, const int *view,
                  double (*uv)[2], int n, int frame)
{
    const int n_frames = f->pictures->capture->n_frames;
    saga_patch then[N_WITNESSES];
    int same = 0, first = frame, last = frame;
    double half;

    /* These values are for a place that stands still: it is visible throughout
     * the segment. */
    s->t_centre = R(0.5);
    s->log2_width = f->rule[SAGA_ATTR_LOG2_WIDTH].hi;
    s->still = true;
    if (!f->o.temporal || n_frames < 2)
        return;
    for (int k = 0; k < n; k++)
        saga_patch_cut(then + k, f->pictures, view[k], frame, uv[k][0],
                       uv[k][1]);
    for (int g = 0; g < n_frames; g++)
        same += unchanged(f, then, view, uv, n, g);
    if (same >= 0.85 * n_frames)
        return;
    /* Otherwise the place exists from the first to the last frame, around this
     * one, in which it looks the same. */
    while (first > 0 && unchanged(f, then, view, uv, n, first - 1))
        first--;
    while (last + 1 < n_frames && unchanged(f, then, view, uv, n, last + 1))
        last++;
    s->still = false;
    s->t_centre = (real)((first + last + 0.0) / 2 / n_frames);
    /* The opacity falls to a half at half the interval, but at least one and a
     * half frames, from its centre. */
    half = (last - first + 1.0) / 2;
    half = (half < 1.5 ? 1.5 : half) / n_frames;
    /* Opacity falls as exp(-u^2), which is a half at u = 0.83 widths. */
    s->log2_width = (real)log2(half / 0.83);
}

static void witness(saga_flat_sight *s, const saga_flat *f,
                    const saga_plane_sweep *w)
{
    const saga_capture *const c = w->pictures->capture;
    int view[N_WITNESSES], n = 1;
    double uv[N_WITNESSES][2];

    view[0] = w->view;
    uv[0][0] = w->uv[0];
    uv[0][1] = w->uv[1];
    for (int k = 0; k < w->n_near && n < N_WITNESSES; k++) {
        double z;
        saga_patch p;

        /* Witnesses are the pixel's own view, and near views that see the same
         * at this moment. An entry for a view that does not is overwritten by
         * the next one. */
        view[n] = w->near[k];
        if (saga_view_project(c->views + view[n], s->position, uv[n], &z) &&
            saga_patch_cut(&p, w->pictures, view[n], w->frame, uv[n][0],
                           uv[n][1]) &&
            saga_patch_distance(&w->own, &p) < SAGA_GOOD_MATCH)
            n++;
    }
    watch(s, f, view, uv, n, w->frame);
}

/* --- Sights -------------------------------------------------------------- */

static void place(saga_flat_sight *s, const saga_plane_sweep *w, double depth)
{
    const saga_source_view *const v = w->pictures->capture->views + w->view;

    s->depth = depth;
    s->footprint = depth / v->fx;
    saga_view_lift(v, w->uv, depth, s->position);
    for (int k = 0; k < 3; k++)
        s->rgb[k] = (real)w->own.at[2 * PATCH * (PATCH + 1)][k];
}

/* Sets the position of a sight. Returns false if its depth is a guess. */
static bool find_place(saga_flat_sight *s, const saga_plane_sweep *w)
{
    saga_plane_found found;
    const bool trusted = saga_plane_find(&found, w);

    place(s, w, found.depth);
    return trusted;
}

bool saga_flat_look(const saga_flat *f, int view, int frame, double u, double v,
                    saga_flat_sight *s)
{
    bool trusted;
    saga_plane_sweep w;

    memset(s, 0, sizeof *s);
    s->t_centre = R(0.5);
    s->log2_width = f->rule[SAGA_ATTR_LOG2_WIDTH].hi;
    if (!saga_plane_begin(&w, f->pictures, view, frame, u, v))
        return false;
    trusted = find_place(s, &w);
    witness(s, f, &w);
    return trusted;
}

bool saga_flat_look_at_point(const saga_flat *f, const saga_point *p,
                             saga_flat_sight *s)
{
    const saga_capture *const c = f->pictures->capture;
    int view[N_WITNESSES], n = 0;
    double uv[N_WITNESSES][2], depth = INFINITY;

    memset(s, 0, sizeof *s);
    for (int k = 0; k < 3; k++) {
        s->position[k] = p->position[k];
        s->rgb[k] = R(p->rgb[k]) / 255;
    }
    for (int k = 0; k < f->pictures->n_train && n < N_WITNESSES; k++) {
        double z, d = 0;
        saga_patch q;

        view[n] = f->pictures->train[k];
        if (!saga_view_project(c->views + view[n], s->position, uv[n], &z) ||
            !saga_patch_cut(&q, f->pictures, view[n], 0, uv[n][0], uv[n][1]))
            continue;
        for (int j = 0; j < 3; j++)
            d += fabs((double)(s->rgb[j]) -
                      (double)q.at[2 * PATCH * (PATCH + 1)][j]) /
                 3;
        /* The nearest view has the smallest pixel at this place, which is the
         * footprint. */
        if (z < depth) {
            depth = z;
            s->footprint = z / c->views[view[n]].fx;
        }
        /* Only views in which the point's own colour shows are witnesses; in
         * the others something hides it. */
        n += d < 0.15;
    }
    s->depth = depth;
    if (n == 0)
        return false;
    watch(s, f, view, uv, n, 0);
    return true;
}
