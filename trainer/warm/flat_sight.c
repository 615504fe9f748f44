/* SPDX-License-Identifier: MIT
 *
 * A sight is what a pixel says about a place in the scene. A plane sweep finds
 * its depth: the pixel is tried at depths even in 1 / depth; at each, a patch
 * is compared with the patches seen there by the nearest training views at the
 * same moment, and the better half of the views decides, since the others may
 * be covered. Whether the place stands still is then read from its pixels over
 * time.
 */
#include "flat_state.h"

#include <math.h>
#include <string.h>

enum {
    N_NEAR = SAGA_FLAT_NEAR, /* views compared with */
    PATCH = SAGA_FLAT_PATCH, /* (2 PATCH + 1)^2 pixels */
    N_DEPTHS = 64,
    N_FINE = 8,          /* steps of refinement to each side */
    N_WITNESSES = 3      /* views asked whether a place stands still */
};

#define NO_MATCH 0.25    /* cost where no view can tell */
#define GOOD_MATCH 0.1
#define CONTRAST 1.8     /* mean cost over best, to trust a match */
#define STILL 0.05       /* mean difference of patches that are the same */

/* --- Patches ------------------------------------------------------------- */

typedef struct patch { float at[(2 * PATCH + 1) * (2 * PATCH + 1)][3]; } patch;

static void tone(float scale[3], const saga_pictures *p, int view)
{
    for (int k = 0; k < 3; k++)
        scale[k] = (float)(p->exposure[3 * view + k] / 255);
}

/* Says whether all pixels of a square from (x, y) on count. */
static bool counts(const saga_capture *c, int view, int frame, int x, int y,
                   int side)
{
    const uint8_t *const mask = saga_capture_mask(c, view, frame);
    const size_t stride = (size_t)c->views[view].width;

    for (int i = 0; mask && i < side; i++)
        if (memchr(mask + (size_t)(y + i) * stride + (size_t)x, 0,
                   (size_t)side))
            return false;
    return true;
}

/* Cuts the pixel at (u, v) and those around; false if it leaves the picture, or
 * what counts of it. */
static bool cut(patch *p, const saga_pictures *from, int view, int frame,
                double u, double v)
{
    const saga_capture *const c = from->capture;
    const saga_shot *const w = c->views + view;
    float scale[3];
    const uint8_t *rgb;
    int x, y, n = 0;

    if (!(u >= PATCH && v >= PATCH && u < w->width - PATCH &&
          v < w->height - PATCH) ||
        !counts(c, view, frame, (int)u - PATCH, (int)v - PATCH,
                2 * PATCH + 1))
        return false;
    tone(scale, from, view);
    rgb = saga_capture_frame(c, view, frame) +
          (size_t)((int)v - PATCH) * saga_view_row_nbytes(w) +
          (size_t)((int)u - PATCH) * 3;
    for (y = 0; y <= 2 * PATCH; y++, rgb += saga_view_row_nbytes(w))
        for (x = 0; x <= 2 * PATCH; x++, n++)
            for (int k = 0; k < 3; k++)
                p->at[n][k] = scale[k] * (float)rgb[3 * x + k];
    return true;
}

/* Does the same where (u, v) is no pixel's centre: between pixels, linearly. */
static bool cut_between(patch *p, const saga_pictures *from, int view,
                        int frame, double u, double v)
{
    const saga_capture *const c = from->capture;
    const saga_shot *const w = c->views + view;
    const size_t stride = saga_view_row_nbytes(w);
    /* The patch's first sample lies between the pixels left of it
     * and right, whose centres are at + 0.5; the square that is
     * read is one pixel larger. */
    const double left = u - PATCH - 0.5, top = v - PATCH - 0.5;
    const uint8_t *rgb;
    float part[2], scale[3];
    int x, y, n = 0;

    if (!(left >= 0 && top >= 0 && left + 2 * PATCH + 1 < w->width &&
          top + 2 * PATCH + 1 < w->height) ||
        !counts(c, view, frame, (int)left, (int)top, 2 * PATCH + 2))
        return false;
    tone(scale, from, view);
    part[0] = (float)(left - (int)left);
    part[1] = (float)(top - (int)top);
    rgb = saga_capture_frame(c, view, frame) + (size_t)(int)top * stride +
          (size_t)(int)left * 3;
    for (y = 0; y <= 2 * PATCH; y++, rgb += stride)
        for (x = 0; x <= 2 * PATCH; x++, n++)
            for (int k = 0; k < 3; k++) {
                const uint8_t *const a = rgb + 3 * x + k, *const b = a + stride;
                const float up = (float)a[0] + part[0] * (float)(a[3] - a[0]);
                const float low = (float)b[0] + part[0] * (float)(b[3] - b[0]);

                p->at[n][k] = scale[k] * (up + part[1] * (low - up));
            }
    return true;
}

static double distance(const patch *a, const patch *b)
{
    const int n = sizeof a->at / sizeof a->at[0];
    double sum = 0;

    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            sum += fabs((double)(a->at[i][k] - b->at[i][k]));
    return sum / (3 * n);
}

/* --- Depth of a pixel ---------------------------------------------------- */

static double centre_distance(const saga_shot *a, const saga_shot *b)
{
    double sum = 0;

    for (int i = 0; i < 3; i++) {
        double d = 0;

        /* Centres are -R^T t: their difference, one axis
         * of the world at a time. */
        for (int j = 0; j < 3; j++)
            d += a->rotation[3 * j + i] * a->translation[j] -
                 b->rotation[3 * j + i] * b->translation[j];
        sum += d * d;
    }
    return sum;
}

/* Finds the nearest training views that look the same way, nearest first. */
static int near_views(int *near, const saga_flat *f, int view)
{
    const saga_pictures *const p = f->pictures;
    const saga_shot *const all = p->capture->views, *const a = all + view;
    double far[N_NEAR];
    int n = 0;

    for (int k = 0; k < p->n_train; k++) {
        const saga_shot *const b = all + p->train[k];
        double same = 0, d;
        int at;

        /* Row 2 of a rotation looks forward: the cosine of
         * the angle between both. */
        for (int j = 6; j < 9; j++)
            same += a->rotation[j] * b->rotation[j];
        if (p->train[k] == view || same < 0.2)
            continue;
        d = centre_distance(a, b);
        if (n == N_NEAR && d >= far[n - 1])
            continue;
        /* Insertion sort into the N_NEAR nearest so far. */
        n += n < N_NEAR;
        for (at = n - 1; at > 0 && far[at - 1] > d; at--) {
            far[at] = far[at - 1];
            near[at] = near[at - 1];
        }
        far[at] = d;
        near[at] = p->train[k];
    }
    return n;
}

typedef struct sweep {
    const saga_flat *f;
    int view, frame, n_near, near[N_NEAR];
    double uv[2];
    patch own;
} sweep;

/* Mean over the better half of the views that see the place. */
static double match(const sweep *s, double inverse)
{
    const saga_capture *const c = s->f->pictures->capture;
    double cost[N_NEAR], x[3], sum = 0;
    int n = 0, half;

    saga_view_lift(c->views + s->view, s->uv, 1 / inverse, x);
    for (int k = 0; k < s->n_near; k++) {
        double uv[2], z, d;
        patch p;
        int at;

        if (!saga_view_project(c->views + s->near[k], x, uv, &z) ||
            !cut_between(&p, s->f->pictures, s->near[k], s->frame, uv[0],
                         uv[1]))
            continue;
        d = distance(&s->own, &p);
        for (at = n++; at > 0 && cost[at - 1] > d; at--)
            cost[at] = cost[at - 1];
        cost[at] = d;
    }
    if (n == 0)
        return NO_MATCH;
    /* The better half, but never one view alone where two can tell: a single
     * match is easily by chance. */
    half = (n + 1) / 2 < 2 && n >= 2 ? 2 : (n + 1) / 2;
    for (int k = 0; k < half; k++)
        sum += cost[k];
    return sum / half;
}

/* Finds the inverse depths between which the pixel's ray is inside the cube. */
static void ray_range(double *near, double *far, const sweep *s)
{
    const double *const range = s->f->pictures->range + 2 * s->view;

    *near = 1 / range[0];
    *far = 1 / range[1];
}

static double refine(const sweep *s, double best, double step, double *cost)
{
    double found = best;

    for (int i = -N_FINE; i <= N_FINE; i++) {
        /* Between the neighbouring depths of the sweep, both excluded. */
        const double inverse = best + step * i / (N_FINE + 1);
        const double c = inverse > 0 ? match(s, inverse) : NO_MATCH;

        if (c < *cost) {
            *cost = c;
            found = inverse;
        }
    }
    return found;
}

static double find_depth(saga_flat_sight *out, const sweep *s)
{
    double near, far, best = 0, cost = 1e9, sum = 0;

    ray_range(&near, &far, s);
    for (int i = 0; i < N_DEPTHS; i++) {
        /* Even in 1 / depth, so that a step is about as far in the other
         * pictures, whether near or far. */
        const double inverse = far + (near - far) * i / (N_DEPTHS - 1);
        const double c = match(s, inverse);

        sum += c;
        if (c < cost) {
            cost = c;
            best = inverse;
        }
    }
    best = refine(s, best, (near - far) / (N_DEPTHS - 1), &cost);
    out->cost = cost;
    /* Where all depths match alike (a wall of one colour) the
     * best says nothing; 0.005 keeps a perfect match from
     * standing for infinite contrast. */
    out->contrast = sum / N_DEPTHS / (cost + 0.005);
    return 1 / best;
}

/* --- Over time ----------------------------------------------------------- */

/* Says whether any witness still sees at frame g what it saw at `frame`. */
static bool unchanged(const saga_flat *f, const patch *then, const int *view,
                      double (*uv)[2], int n, int g)
{
    for (int k = 0; k < n; k++) {
        patch now;

        if (cut(&now, f->pictures, view[k], g, uv[k][0], uv[k][1]) &&
            distance(then + k, &now) < STILL)
            return true;
    }
    return false;
}

/* Finds the longest stretch without change around a frame. A place that is the
 * same in most frames stands still; what passed before it is someone else's. */
static void watch(saga_flat_sight *s, const saga_flat *f, const int *view,
                  double (*uv)[2], int n, int frame)
{
    const int n_frames = f->pictures->capture->n_frames;
    patch then[N_WITNESSES];
    int same = 0, first = frame, last = frame;
    double half;

    /* As if it stood still: life all through the segment. */
    s->t_centre = R(0.5);
    s->log2_width = f->rule[SAGA_ATTR_LOG2_WIDTH].hi;
    s->still = true;
    if (!f->o.temporal || n_frames < 2)
        return;
    for (int k = 0; k < n; k++)
        cut(then + k, f->pictures, view[k], frame, uv[k][0], uv[k][1]);
    for (int g = 0; g < n_frames; g++)
        same += unchanged(f, then, view, uv, n, g);
    if (same >= 0.85 * n_frames)
        return;
    /* Not still: it lives from the first to the last frame around this one in
     * which it looks as it does now. */
    while (first > 0 && unchanged(f, then, view, uv, n, first - 1))
        first--;
    while (last + 1 < n_frames && unchanged(f, then, view, uv, n, last + 1))
        last++;
    s->still = false;
    s->t_centre = (real)((first + last + 0.0) / 2 / n_frames);
    /* Half opacity half a stretch, but at least a frame and a half, away. */
    half = (last - first + 1.0) / 2;
    half = (half < 1.5 ? 1.5 : half) / n_frames;
    /* Opacity falls as exp(-u^2), which is a half at u = 0.83 widths. */
    s->log2_width = (real)log2(half / 0.83);
}

static void witness(saga_flat_sight *s, const sweep *w)
{
    const saga_capture *const c = w->f->pictures->capture;
    int view[N_WITNESSES], n = 1;
    double uv[N_WITNESSES][2];

    view[0] = w->view;
    uv[0][0] = w->uv[0];
    uv[0][1] = w->uv[1];
    for (int k = 0; k < w->n_near && n < N_WITNESSES; k++) {
        double z;
        patch p;

        /* The pixel's own view, and near ones that see the same there at this
         * moment. A view that does not is overwritten by the next one. */
        view[n] = w->near[k];
        if (saga_view_project(c->views + view[n], s->position, uv[n], &z) &&
            cut(&p, w->f->pictures, view[n], w->frame, uv[n][0], uv[n][1]) &&
            distance(&w->own, &p) < GOOD_MATCH)
            n++;
    }
    watch(s, w->f, view, uv, n, w->frame);
}

/* --- Sights -------------------------------------------------------------- */

static void place(saga_flat_sight *s, const sweep *w, double depth)
{
    const saga_shot *const v = w->f->pictures->capture->views + w->view;

    s->depth = depth;
    s->footprint = depth / v->fx;
    saga_view_lift(v, w->uv, depth, s->position);
    for (int k = 0; k < 3; k++)
        s->rgb[k] = (real)w->own.at[2 * PATCH * (PATCH + 1)][k];
}

static bool begin(sweep *w, const saga_flat *f, int view, int frame, double u,
                  double v)
{
    w->f = f;
    w->view = view;
    w->frame = frame;
    /* To the pixel's centre: its own patch is cut without interpolation. */
    w->uv[0] = floor(u) + 0.5;
    w->uv[1] = floor(v) + 0.5;
    w->n_near = near_views(w->near, f, view);
    return cut(&w->own, f->pictures, view, frame, u, v);
}

/* Returns false where the depth is a guess. */
static bool find_place(saga_flat_sight *s, const sweep *w)
{
    place(s, w, find_depth(s, w));
    return w->n_near > 0 && s->cost < GOOD_MATCH && s->contrast > CONTRAST;
}

bool saga_flat_look(const saga_flat *f, int view, int frame, double u,
                    double v, saga_flat_sight *s)
{
    bool trusted;
    sweep w;

    memset(s, 0, sizeof *s);
    s->t_centre = R(0.5);
    s->log2_width = f->rule[SAGA_ATTR_LOG2_WIDTH].hi;
    if (!begin(&w, f, view, frame, u, v))
        return false;
    trusted = find_place(s, &w);
    witness(s, &w);
    return trusted;
}

/* Sums the channels of a patch; false if a pixel is nearly black or white, so
 * that a picture may have cut it off. */
static bool sum_of(double sum[3], const patch *p)
{
    for (int k = 0; k < 3; k++) {
        sum[k] = 0;
        for (size_t i = 0; i < sizeof p->at / sizeof p->at[0]; i++) {
            const double x = (double)p->at[i][k];

            if (!(x > 0.04 && x < 0.94))
                return false;
            sum[k] += x;
        }
    }
    return true;
}

int saga_flat_compare(const saga_flat *f, int view, int frame, double u,
                      double v, saga_flat_ratio ratio[SAGA_FLAT_NEAR])
{
    const saga_capture *const c = f->pictures->capture;
    double own[3], other[3], uv[2], z;
    saga_flat_sight s;
    sweep w;
    patch p;
    int n = 0;

    if (!begin(&w, f, view, frame, u, v) || !sum_of(own, &w.own) ||
        !find_place(&s, &w))
        return 0;
    for (int i = 0; i < w.n_near; i++) {
        if (!saga_view_project(c->views + w.near[i], s.position, uv, &z) ||
            !cut_between(&p, f->pictures, w.near[i], frame, uv[0], uv[1]) ||
            !sum_of(other, &p))
            continue;
        ratio[n].view = w.near[i];
        for (int k = 0; k < 3; k++)
            ratio[n].log[k] = log(own[k] / other[k]);
        n++;
    }
    return n;
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
        patch q;

        view[n] = f->pictures->train[k];
        if (!saga_view_project(c->views + view[n], s->position, uv[n], &z) ||
            !cut(&q, f->pictures, view[n], 0, uv[n][0], uv[n][1]))
            continue;
        for (int j = 0; j < 3; j++)
            d += fabs((double)(s->rgb[j]) -
                      (double)q.at[2 * PATCH * (PATCH + 1)][j]) / 3;
        /* The view nearest to it sees the smallest pixel there,
         * which is the footprint. */
        if (z < depth) {
            depth = z;
            s->footprint = z / c->views[view[n]].fx;
        }
        /* Only a view where the point's own colour shows is a witness;
         * elsewhere it is covered. */
        n += d < 0.15;
    }
    s->depth = depth;
    if (n == 0)
        return false;
    watch(s, f, view, uv, n, 0);
    return true;
}
