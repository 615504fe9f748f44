/* SPDX-License-Identifier: MIT */
#include "plane_sweep.h"

#include "order.h"

#include <math.h>
#include <string.h>

enum {
    PATCH = SAGA_PATCH,
    SIDE = SAGA_PATCH_SIDE,
    ROW = SAGA_PATCH_ROW,
    N_NEAR = SAGA_PLANE_NEAR,
    N_DEPTHS = 64,
    N_FINE = 8 /* refinement steps on each side */
};

#define NO_MATCH 0.25 /* cost if no view sees the place */
/* Least mean cost over best cost for a trusted match. */
#define CONTRAST 1.8

/* --- Patches ------------------------------------------------------------- */

/* Sets the factors of a row's values, that of what follows the pixels to 0. */
static void exposure_of(float scale[ROW], const saga_pictures *p, int view)
{
    float channel[3];

    for (int k = 0; k < 3; k++)
        channel[k] = (float)(p->exposure[3 * view + k] / 255);
    for (int i = 0; i < ROW; i++)
        scale[i] = i < 3 * SIDE ? channel[i % 3] : 0;
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
    float scale[ROW];
    const uint8_t *rgb;

    if (!(u >= PATCH && v >= PATCH && u < w->width - PATCH &&
          v < w->height - PATCH) ||
        !counts(c, view, frame, (int)u - PATCH, (int)v - PATCH, SIDE))
        return false;
    exposure_of(scale, from, view);
    rgb = saga_capture_frame(c, view, frame) +
          (size_t)((int)v - PATCH) * saga_view_row_nbytes(w) +
          (size_t)((int)u - PATCH) * 3;
    /* What follows the pixels of a row stays 0. */
    for (int y = 0; y < SIDE; y++, rgb += saga_view_row_nbytes(w)) {
        uint8_t row[ROW] = { 0 };

        memcpy(row, rgb, 3 * SIDE);
        for (int i = 0; i < ROW; i++)
            p->at[y][i] = scale[i] * (float)row[i];
    }
    return true;
}

/* Interpolates between each value of a row of SIDE + 1 pixels and that of the
 * next pixel. What follows 3 SIDE values means nothing, and has the factor 0.
 */
static void between_columns(float to[ROW], const uint8_t *rgb, float part)
{
    enum { PADDED = ROW + 4 }; /* ROW + 3 are read, in vectors of four */
    _Static_assert(3 * SIDE <= ROW && 3 * (SIDE + 1) <= PADDED, "room");
    uint8_t row[PADDED] = { 0 };
    float x[PADDED];

    memcpy(row, rgb, 3 * (SIDE + 1));
    for (int i = 0; i < PADDED; i++)
        x[i] = (float)row[i];
    for (int i = 0; i < ROW; i++)
        to[i] = x[i] + part * (x[i + 3] - x[i]);
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
    float part[2], scale[ROW], row[2][ROW];
    const uint8_t *rgb;

    if (!(left >= 0 && top >= 0 && left + SIDE < w->width &&
          top + SIDE < w->height) ||
        !counts(c, view, frame, (int)left, (int)top, SIDE + 1))
        return false;
    exposure_of(scale, from, view);
    part[0] = (float)(left - (int)left);
    part[1] = (float)(top - (int)top);
    rgb = saga_capture_frame(c, view, frame) + (size_t)(int)top * stride +
          (size_t)(int)left * 3;
    /* Each row of samples lies between two rows of the picture, which are
     * interpolated along u once. */
    between_columns(row[0], rgb, part[0]);
    for (int y = 0; y < SIDE; y++) {
        const float *const up = row[y & 1];
        float *const low = row[~y & 1];

        between_columns(low, rgb += stride, part[0]);
        for (int i = 0; i < ROW; i++)
            p->at[y][i] = scale[i] * (up[i] + part[1] * (low[i] - up[i]));
    }
    return true;
}

double saga_patch_distance(const saga_patch *a, const saga_patch *b)
{
    float columns[ROW] = { 0 };
    double sum = 0;

    for (int y = 0; y < SIDE; y++)
        for (int i = 0; i < ROW; i++)
            columns[i] += fabsf(a->at[y][i] - b->at[y][i]);
    for (int i = 0; i < ROW; i++)
        sum += (double)columns[i];
    return sum / (3 * SIDE * SIDE);
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
