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
    N_WITNESSES = 3 /* views that decide whether a place stands still */
};

/* Largest mean difference of patches that count as equal. */
#define STILL 0.05

/* --- Over time ----------------------------------------------------------- */

/* Views that see a place at the same moment, and their patches there. */
typedef struct witnesses {
    const saga_pictures *pictures;
    int n, view[N_WITNESSES];
    double uv[N_WITNESSES][2];
    saga_patch then[N_WITNESSES];
} witnesses;

/* Tells whether any witness sees at frame g what it saw then. */
static bool unchanged(const witnesses *w, int g)
{
    for (int k = 0; k < w->n; k++) {
        saga_patch now;

        if (saga_patch_cut(&now, w->pictures, w->view[k], g, w->uv[k][0],
                           w->uv[k][1]) &&
            saga_patch_distance(w->then + k, &now) < STILL)
            return true;
    }
    return false;
}

/* Returns the frame at which the place begins (step -1) or ends (step 1) to
 * look as at a frame: halfway between the last moment that is the same and the
 * next one. */
static double edge(const bool *same, const saga_pictures *p, int frame,
                   int step)
{
    const int n = saga_pictures_n_moments(p);
    int last = frame;

    for (int k = step < 0 ? n - 1 : 0; k >= 0 && k < n; k += step) {
        const int g = saga_pictures_moment(p, k);

        if ((g - frame) * step <= 0)
            continue;
        if (!same[k])
            return (last + g) / 2.0;
        last = g;
    }
    return step < 0 ? -0.5 : p->capture->n_frames - 0.5;
}

/* Finds the longest interval without change around a frame, and sets the
 * temporal attributes accordingly. A place that looks the same at most moments
 * stands still; whatever passes in front of it for a while belongs to other
 * primitives. */
static void watch(saga_flat_sight *s, const saga_flat *f, witnesses *w,
                  int frame)
{
    const int n_frames = f->pictures->capture->n_frames;
    const int n_moments = saga_pictures_n_moments(f->pictures);
    bool same[SAGA_MOST_LOOKED_AT];
    int n_same = 0;
    double begin, end, half;

    /* These values are for a place that stands still: it is visible throughout
     * the segment. */
    s->t_centre = R(0.5);
    s->log2_width = f->rule[SAGA_ATTR_LOG2_WIDTH].hi;
    s->still = true;
    if (!f->o.temporal || n_frames < 2)
        return;
    for (int k = 0; k < w->n; k++)
        saga_patch_cut(w->then + k, f->pictures, w->view[k], frame, w->uv[k][0],
                       w->uv[k][1]);
    for (int k = 0; k < n_moments; k++) {
        same[k] = unchanged(w, saga_pictures_moment(f->pictures, k));
        n_same += same[k];
    }
    if (n_same >= 0.85 * n_moments)
        return;
    /* Otherwise the place exists around this frame, as long as it looks the
     * same. */
    begin = edge(same, f->pictures, frame, -1);
    end = edge(same, f->pictures, frame, 1);
    s->still = false;
    s->t_centre = (real)((begin + end) / 2 / n_frames);
    /* The opacity falls to a half at half the interval, but at least one and a
     * half frames, from its centre. */
    half = (end - begin) / 2;
    half = (half < 1.5 ? 1.5 : half) / n_frames;
    /* Opacity falls as exp(-u^2), which is a half at u = 0.83 widths. */
    s->log2_width = (real)log2(half / 0.83);
}

static void witness(saga_flat_sight *s, const saga_flat *f,
                    const saga_plane_sweep *w)
{
    const saga_capture *const c = w->pictures->capture;
    witnesses by = { .pictures = f->pictures, .n = 1, .view = { w->view } };

    by.uv[0][0] = w->uv[0];
    by.uv[0][1] = w->uv[1];
    for (int k = 0; k < w->n_near && by.n < N_WITNESSES; k++) {
        double *const uv = by.uv[by.n], z;
        saga_patch p;

        /* Witnesses are the pixel's own view, and near views that see the same
         * at this moment. An entry for a view that does not is overwritten by
         * the next one. */
        by.view[by.n] = w->near[k];
        if (saga_view_project(c->views + w->near[k], s->position, uv, &z) &&
            saga_patch_cut(&p, w->pictures, w->near[k], w->frame, uv[0],
                           uv[1]) &&
            saga_patch_distance(&w->own, &p) < SAGA_GOOD_MATCH)
            by.n++;
    }
    watch(s, f, &by, w->frame);
}

/* --- Sights -------------------------------------------------------------- */

static void place(saga_flat_sight *s, const saga_plane_sweep *w, double depth)
{
    const saga_source_view *const v = w->pictures->capture->views + w->view;

    s->depth = depth;
    s->footprint = depth / v->fx;
    saga_view_lift(v, w->uv, depth, s->position);
    for (int k = 0; k < 3; k++)
        s->rgb[k] = (real)w->own.at[SAGA_PATCH][3 * SAGA_PATCH + k];
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
    witnesses w = { .pictures = f->pictures };
    double depth = INFINITY;

    memset(s, 0, sizeof *s);
    for (int k = 0; k < 3; k++) {
        s->position[k] = p->position[k];
        s->rgb[k] = R(p->rgb[k]) / 255;
    }
    for (int k = 0; k < f->pictures->n_train && w.n < N_WITNESSES; k++) {
        const int view = f->pictures->train[k];
        double *const uv = w.uv[w.n], z, d = 0;
        saga_patch q;

        w.view[w.n] = view;
        if (!saga_view_project(c->views + view, s->position, uv, &z) ||
            !saga_patch_cut(&q, f->pictures, view, 0, uv[0], uv[1]))
            continue;
        for (int j = 0; j < 3; j++)
            d += fabs((double)(s->rgb[j]) -
                      (double)q.at[SAGA_PATCH][3 * SAGA_PATCH + j]) /
                 3;
        /* The nearest view has the smallest pixel at this place, which is the
         * footprint. */
        if (z < depth) {
            depth = z;
            s->footprint = z / c->views[view].fx;
        }
        /* Only views in which the point's own colour shows are witnesses; in
         * the others something hides it. */
        w.n += d < 0.15;
    }
    s->depth = depth;
    if (w.n == 0)
        return false;
    watch(s, f, &w, 0);
    return true;
}
