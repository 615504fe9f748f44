/* SPDX-License-Identifier: MIT */
#include "plane_sweep.h"

#include "order.h"

#include <math.h>
#include <string.h>

enum {
    PATCH = SAGA_PATCH,
    N_NEAR = SAGA_PLANE_NEAR,
    N_DEPTHS = 64,
    N_FINE = 8 /* refinement steps on each side */
};

#define NO_MATCH 0.25 /* cost if no view sees the place */
/* Least mean cost over best cost for a trusted match. */
#define CONTRAST 1.8

/* --- Patches ------------------------------------------------------------- */

static void exposure_of(float scale[3], const saga_pictures *p, int view)
{
    for (int k = 0; k < 3; k++)
        scale[k] = (float)(p->exposure[3 * view + k] / 255);
}

/* Tells whether all pixels of a square from (x, y) on count. */
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

bool saga_patch_cut(saga_patch *p, const saga_pictures *from, int view,
                    int frame, double u, double v)
{
    const saga_capture *const c = from->capture;
    const saga_source_view *const w = c->views + view;
    float scale[3];
    const uint8_t *rgb;
    int x, y, n = 0;

    if (!(u >= PATCH && v >= PATCH && u < w->width - PATCH &&
          v < w->height - PATCH) ||
        !counts(c, view, frame, (int)u - PATCH, (int)v - PATCH, 2 * PATCH + 1))
        return false;
    exposure_of(scale, from, view);
    rgb = saga_capture_frame(c, view, frame) +
          (size_t)((int)v - PATCH) * saga_view_row_nbytes(w) +
          (size_t)((int)u - PATCH) * 3;
    for (y = 0; y <= 2 * PATCH; y++, rgb += saga_view_row_nbytes(w))
        for (x = 0; x <= 2 * PATCH; x++, n++)
            for (int k = 0; k < 3; k++)
                p->at[n][k] = scale[k] * (float)rgb[3 * x + k];
    return true;
}

bool saga_patch_between(saga_patch *p, const saga_pictures *from, int view,
                        int frame, double u, double v)
{
    const saga_capture *const c = from->capture;
    const saga_source_view *const w = c->views + view;
    const size_t stride = saga_view_row_nbytes(w);
    /* The first sample of the patch is between pixels, whose centres are
     * at + 0.5; the square that is read is one pixel larger. */
    const double left = u - PATCH - 0.5, top = v - PATCH - 0.5;
    const uint8_t *rgb;
    float part[2], scale[3];
    int x, y, n = 0;

    if (!(left >= 0 && top >= 0 && left + 2 * PATCH + 1 < w->width &&
          top + 2 * PATCH + 1 < w->height) ||
        !counts(c, view, frame, (int)left, (int)top, 2 * PATCH + 2))
        return false;
    exposure_of(scale, from, view);
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

double saga_patch_distance(const saga_patch *a, const saga_patch *b)
{
    const int n = sizeof a->at / sizeof a->at[0];
    double sum = 0;

    for (int i = 0; i < n; i++)
        for (int k = 0; k < 3; k++)
            sum += fabs((double)(a->at[i][k] - b->at[i][k]));
    return sum / (3 * n);
}

/* --- Depth of a pixel ---------------------------------------------------- */

static double centre_distance(const saga_source_view *a,
                              const saga_source_view *b)
{
    double sum = 0;

    for (int i = 0; i < 3; i++) {
        double d = 0;

        /* Centres are -R^T t; this is their difference along one axis of the
         * world. */
        for (int j = 0; j < 3; j++)
            d += a->rotation[3 * j + i] * a->translation[j] -
                 b->rotation[3 * j + i] * b->translation[j];
        sum += d * d;
    }
    return sum;
}

/* Finds the nearest training views that look in a similar direction, nearest
 * first. Returns their number. */
static int near_views(int *near, const saga_pictures *p, int view)
{
    const saga_source_view *const all = p->capture->views, *const a = all +
                                                                      view;
    double far[N_NEAR];
    int n = 0;

    for (int k = 0; k < p->n_train; k++) {
        const saga_source_view *const b = all + p->train[k];
        double same = 0;

        /* Row 2 of a rotation is the forward axis; `same` is the cosine of the
         * angle between both. */
        for (int j = 6; j < 9; j++)
            same += a->rotation[j] * b->rotation[j];
        if (p->train[k] != view && same >= 0.2)
            n = saga_nearest_add(near, far, n, N_NEAR, p->train[k],
                                 centre_distance(a, b));
    }
    return n;
}

bool saga_plane_begin(saga_plane_sweep *s, const saga_pictures *pictures,
                      int view, int frame, double u, double v)
{
    s->pictures = pictures;
    s->view = view;
    s->frame = frame;
    /* The pixel's centre is used, where its own patch needs no
     * interpolation. */
    s->uv[0] = floor(u) + 0.5;
    s->uv[1] = floor(v) + 0.5;
    s->n_near = near_views(s->near, pictures, view);
    return saga_patch_cut(&s->own, pictures, view, frame, u, v);
}

/* Returns the mean cost over the better half of the views that see the
 * place. */
static double match(const saga_plane_sweep *s, double inverse)
{
    const saga_capture *const c = s->pictures->capture;
    double cost[N_NEAR], x[3], sum = 0;
    int n = 0, half;

    saga_view_lift(c->views + s->view, s->uv, 1 / inverse, x);
    for (int k = 0; k < s->n_near; k++) {
        double uv[2], z, d;
        saga_patch p;
        int at;

        if (!saga_view_project(c->views + s->near[k], x, uv, &z) ||
            !saga_patch_between(&p, s->pictures, s->near[k], s->frame, uv[0],
                                uv[1]))
            continue;
        d = saga_patch_distance(&s->own, &p);
        for (at = n++; at > 0 && cost[at - 1] > d; at--)
            cost[at] = cost[at - 1];
        cost[at] = d;
    }
    if (n == 0)
        return NO_MATCH;
    /* The better half, but at least two views if two see the place: a single
     * match is too often accidental. */
    half = (n + 1) / 2 < 2 && n >= 2 ? 2 : (n + 1) / 2;
    for (int k = 0; k < half; k++)
        sum += cost[k];
    return sum / half;
}

/* Sets the inverse of the nearest and farthest depth of the view. */
static void ray_range(double *near, double *far, const saga_plane_sweep *s)
{
    const double *const range = s->pictures->range + 2 * s->view;

    *near = 1 / range[0];
    *far = 1 / range[1];
}

static double refine(const saga_plane_sweep *s, double best, double step,
                     double *cost)
{
    double found = best;

    for (int i = -N_FINE; i <= N_FINE; i++) {
        /* Depths between the neighbours of the best one are tried, both
         * excluded. */
        const double inverse = best + step * i / (N_FINE + 1);
        const double c = inverse > 0 ? match(s, inverse) : NO_MATCH;

        if (c < *cost) {
            *cost = c;
            found = inverse;
        }
    }
    return found;
}

bool saga_plane_find(saga_plane_found *found, const saga_plane_sweep *s)
{
    double near, far, best = 0, cost = 1e9, sum = 0;

    ray_range(&near, &far, s);
    for (int i = 0; i < N_DEPTHS; i++) {
        /* Depths are even in 1 / depth, so that each step is about equally long
         * in the other pictures. */
        const double inverse = far + (near - far) * i / (N_DEPTHS - 1);
        const double c = match(s, inverse);

        sum += c;
        if (c < cost) {
            cost = c;
            best = inverse;
        }
    }
    best = refine(s, best, (near - far) / (N_DEPTHS - 1), &cost);
    found->cost = cost;
    /* If all depths match equally well (a wall of one colour), the best one
     * means nothing. The 0.005 avoids infinite contrast for a perfect match. */
    found->contrast = sum / N_DEPTHS / (cost + 0.005);
    found->depth = 1 / best;
    return s->n_near > 0 && cost < SAGA_GOOD_MATCH &&
           found->contrast > CONTRAST;
}
