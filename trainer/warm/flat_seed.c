/* SPDX-License-Identifier: MIT
 *
 * Primitives come from the capture's points, and from pixels whose depth a
 * plane sweep finds. A pixel of a picture is tried at depths even in 1 / depth;
 * at each, a patch is compared with the patches seen there by the nearest
 * training views at the same moment, and the better half of the views decides,
 * since the others may be covered. Whether the place stands still is then read
 * from its pixels over time.
 */
#include "flat_state.h"

#include "alloc.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    N_NEAR = SAGA_FLAT_NEAR,
                         /* views compared with */
    PATCH = 2,           /* (2 PATCH + 1)^2 pixels */
    N_DEPTHS = 64,
    N_FINE = 8,          /* steps of refinement to each side */
    N_NEIGHBOURS = 3,    /* whose distance gives the scale */
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

/* Returns false where the depth is a guess; the rest of *s is then filled all
 * the same, unless the pixel is too near to the border (depth 0). */
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

void saga_flat_add(saga_flat *f, const saga_flat_sight *s, double sigma)
{
    const saga_cube *const cube = &f->pictures->cube;
    const real scale = (real)log2(sigma / cube->unit);
    const uint32_t i = saga_flat_append(f);
    const saga_range this = { i, i + 1 };

    for (size_t a = 0; a < 3; a++) {
        const size_t at = 3 * (size_t)i + a;

        f->value.mean[at] = (real)((s->position[a] - cube->centre[a]) /
                                   cube->unit);
        f->value.log2_scale[at] = scale;
        f->value.colour[at] = s->rgb[a];
    }
    if (f->o.temporal) {
        f->value.t_centre[i] = s->t_centre;
        f->value.log2_width[i] = s->log2_width;
    }
    saga_flat_bound(f, SAGA_ATTR_MEAN, this);
    saga_flat_bound(f, SAGA_ATTR_LOG2_SCALE, this);
    saga_flat_bound(f, SAGA_ATTR_LOG2_WIDTH, this);
}

/* --- The first set ------------------------------------------------------- */

/* Looks at a point of the capture, seen at frame 0 by the views where its
 * colour fits. */
static bool look_at_point(const saga_flat *f, const saga_point *p,
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

/* A draw is a pixel at random; chance is what its depth is if nobody knows. */
typedef struct draw { int view, frame; double uv[2], chance; } draw;

static draw draw_pixel(const saga_flat *f, uint64_t counter)
{
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_SEED);
    const saga_pictures *const p = f->pictures;
    const uint64_t c = counter * 5;
    const int view = p->train[saga_rng_below(r, c, (uint32_t)p->n_train)];
    const saga_shot *const v = p->capture->views + view;

    /* A draw is a function of its number alone, so that the borrowing pass,
     * which comes later, draws the same pixel again. */
    return (draw){
        .view = view,
        .frame = (int)saga_rng_below(r, c + 1,
                                     (uint32_t)p->capture->n_frames),
        .uv = { PATCH + saga_rng_double(r, c + 2) * (v->width - 2 * PATCH),
                PATCH + saga_rng_double(r, c + 3) * (v->height - 2 * PATCH) },
        .chance = saga_rng_double(r, c + 4)
    };
}

/* This holds all sights, and which of them are trusted. */
typedef struct sights {
    saga_flat_sight *at;
    uint8_t *good;
    size_t n;
} sights;

/* Gives a guess the depth of the nearest trusted sight in the same picture. */
static void borrow_depth(saga_flat_sight *s, const saga_flat *f, const draw *d,
                         const sights *all)
{
    const saga_shot *const w = f->pictures->capture->views + d->view;
    const double *const range = f->pictures->range + 2 * d->view;
    double best = INFINITY, z;

    /* Without any trusted one in the picture: by chance, even in 1 / depth. */
    z = 1 / (1 / range[1] + d->chance * (1 / range[0] - 1 / range[1]));
    for (size_t i = 0; i < all->n; i++) {
        double uv[2], depth, far;

        if (!all->good[i] ||
            !saga_view_project(w, all->at[i].position, uv, &depth))
            continue;
        far = (uv[0] - d->uv[0]) * (uv[0] - d->uv[0]) +
              (uv[1] - d->uv[1]) * (uv[1] - d->uv[1]);
        if (far < best) {
            best = far;
            z = depth;
        }
    }
    s->depth = z;
    s->footprint = z / w->fx;
    saga_view_lift(w, d->uv, z, s->position);
}

static size_t look_at_points(saga_flat_sight *s, const saga_flat *f,
                             size_t room)
{
    const size_t n = f->pictures->capture->n_points;
    const size_t take = n < room ? n : room;
    size_t found = 0;

    /* Evenly over the list where there is no room for all. A point that nobody
     * sees leaves its place to the next. */
    for (size_t i = 0; i < take; i++)
        found += look_at_point(f, f->pictures->capture->points + i * n / take,
                               s + found);
    return found;
}

typedef struct { const sights *all; const saga_flat *f; size_t from; } job;

static saga_range pixels_of(const job *j, size_t part)
{
    const saga_range of = saga_part(j->all->n - j->from, SAGA_FLAT_LOOKS,
                                    part);

    return (saga_range){ j->from + of.begin, j->from + of.end };
}

static void look_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = pixels_of(j, part);

    for (size_t i = of.begin; i < of.end; i++) {
        const draw d = draw_pixel(j->f, i);

        j->all->good[i] = saga_flat_look(j->f, d.view, d.frame, d.uv[0],
                                         d.uv[1], j->all->at + i);
    }
}

static void borrow_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = pixels_of(j, part);

    for (size_t i = of.begin; i < of.end; i++) {
        const draw d = draw_pixel(j->f, i);

        if (!j->all->good[i])
            borrow_depth(j->all->at + i, j->f, &d, j->all);
    }
}

/* Fills all from `from` on with pixels drawn at random. */
static void look_at_pixels(const sights *all, const saga_flat *f, size_t from)
{
    job j = { all, f, from };
    saga_tasks t = { .run = look_part, .user = &j,
                     .n = saga_n_parts(all->n - from, SAGA_FLAT_LOOKS),
                     .ns = (double)SAGA_FLAT_LOOK_NS *
                           (double)(all->n - from) };

    saga_parallel(&t);
    t.run = borrow_part;
    saga_parallel(&t);
}

typedef struct along { double x; size_t i; } along;

static int compare_along(const void *a, const void *b)
{
    const along *const p = a, *const q = b;

    if (p->x != q->x)
        return p->x < q->x ? -1 : 1;
    return (p->i > q->i) - (p->i < q->i);
}

static void note_neighbour(double *best, double d)
{
    int at = N_NEIGHBOURS - 1;

    if (!(d < best[at]))
        return;
    for (; at > 0 && best[at - 1] > d; at--)
        best[at] = best[at - 1];
    best[at] = d;
}

/* Returns the squared distance of the places at ranks a and b. */
static double between(const saga_flat_sight *s, const along *order, size_t a,
                      size_t b)
{
    const double *const p = s[order[a].i].position;
    const double *const q = s[order[b].i].position;

    return (p[0] - q[0]) * (p[0] - q[0]) + (p[1] - q[1]) * (p[1] - q[1]) +
           (p[2] - q[2]) * (p[2] - q[2]);
}

/* Finds the RMS distance to the nearest places: outwards along x from each,
 * until x alone is farther than the worst of the best. */
static double spacing(const saga_flat_sight *s, const along *order, size_t k,
                      size_t n)
{
    double best[N_NEIGHBOURS] = { INFINITY, INFINITY, INFINITY }, sum = 0;
    int found = 0;
    size_t j;

    for (j = k + 1; j < n; j++) {
        const double dx = order[j].x - order[k].x;

        if (dx * dx > best[N_NEIGHBOURS - 1])
            break;
        note_neighbour(best, between(s, order, k, j));
    }
    for (j = k; j-- > 0;) {
        const double dx = order[k].x - order[j].x;

        if (dx * dx > best[N_NEIGHBOURS - 1])
            break;
        note_neighbour(best, between(s, order, k, j));
    }
    for (int i = 0; i < N_NEIGHBOURS; i++)
        if (best[i] < INFINITY) {
            sum += best[i];
            found++;
        }
    return found ? sqrt(sum / found) : INFINITY;
}

static void append_all(saga_flat *f, const saga_flat_sight *s, along *order,
                       size_t n)
{
    for (size_t i = 0; i < n; i++)
        order[i] = (along){ s[i].position[0], i };
    qsort(order, n, sizeof *order, compare_along);
    for (size_t k = 0; k < n; k++) {
        const saga_flat_sight *const at = s + order[k].i;
        double d = spacing(s, order, k, n);

        /* Pixels: neither below what is visible nor a cloud. */
        d = d < 40 * at->footprint ? d : 40 * at->footprint;
        d = d > at->footprint ? d : at->footprint;
        saga_flat_add(f, at, 0.5 * d);
    }
}

bool saga_flat_init(saga_flat *f, saga_error *error)
{
    static const char what[] = "the first primitives";
    const size_t asked = (size_t)(f->o.start * (real)f->o.n_primitives);
    const size_t n = asked < 1 ? 1 : asked;
    const sights all = { saga_alloc(n, sizeof *all.at, what, error),
                         saga_alloc(n, 1, what, error), n };
    along *const order = saga_alloc(n, sizeof *order, what, error);
    const bool ok = all.at && all.good && order &&
                    saga_flat_reserve(f, (uint32_t)n, error);

    if (ok) {
        /* Points are trusted as they are, and take half
         * of the places at most. */
        memset(all.good, 1, n);
        look_at_pixels(&all, f, look_at_points(all.at, f, (n + 1) / 2));
        append_all(f, all.at, order, n);
    }
    free(all.at);
    free(all.good);
    free(order);
    return ok;
}
