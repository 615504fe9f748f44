/* SPDX-License-Identifier: MIT */
#include "novel.h"

#include "alloc.h"
#include "camera.h"
#include "lone.h"
#include "order.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Neighbours of a view, and cameras between two views; more of either gains
 * nothing. */
enum { N_NEIGHBOURS = 2, N_BETWEEN = 3 };

/* Views closer than this gain nothing by pictures between them
 * (docs/lab/teachers.md): 20 degrees, in radians. */
#define LEAST_ANGLE 0.349

/* Views farther apart than this share too little; teachers would guess, which
 * would harm the filmed views: 40 degrees, in radians. */
#define MOST_ANGLE 0.7

/* The part of the pictures that teachers draw, in a still and in a moving
 * scene. With a half, the filmed views of a still lose another 0.4 dB, and
 * nothing is gained. Teachers of a moving scene know each moment from a few
 * visits only; with three in ten, what moves loses another 0.1 dB, and nothing
 * is gained (docs/lab/teachers.md). */
#define STILL_PART 0.3
#define MOVING_PART 0.15

/* Stream of random numbers (rng.h). */
enum { STREAM_NOVEL = 500 };

static const char what[] = "the teachers";

/* --- Cameras ------------------------------------------------------------- */

/* Sets r to rotation a, turned by the part u of the way to b. */
static void turn(double r[9], const double *a, const double *b, double u)
{
    double between[9], by[9], axis[3], sine, angle;

    /* B A^T = exp(angle [axis]x). Its antisymmetric part is twice the axis
     * times the sine; its trace is 1 + 2 times the cosine. */
    for (int i = 0; i < 9; i++)
        between[i] = b[i / 3 * 3] * a[i % 3 * 3] +
                     b[i / 3 * 3 + 1] * a[i % 3 * 3 + 1] +
                     b[i / 3 * 3 + 2] * a[i % 3 * 3 + 2];
    axis[0] = between[7] - between[5];
    axis[1] = between[2] - between[6];
    axis[2] = between[3] - between[1];
    sine = length3(axis);
    angle = u * atan2(sine, between[0] + between[4] + between[8] - 1);
    for (int i = 0; i < 3; i++)
        axis[i] = sine > 0 ? axis[i] / sine : 0;
    /* Rodrigues' formula: cos 1 + sin [axis]x + (1 - cos) axis axis^T. */
    for (int i = 0; i < 9; i++)
        by[i] = (i % 4 ? 0 : cos(angle)) +
                (1 - cos(angle)) * axis[i / 3] * axis[i % 3];
    for (int i = 0; i < 3; i++) {
        const int j = (i + 1) % 3, k = (i + 2) % 3;

        by[3 * j + k] -= sin(angle) * axis[i];
        by[3 * k + j] += sin(angle) * axis[i];
    }
    if (!(sine > 0))
        memcpy(by, (double[9]){ 1, 0, 0, 0, 1, 0, 0, 0, 1 }, sizeof by);
    for (int i = 0; i < 9; i++)
        r[i] = by[i / 3 * 3] * a[i % 3] + by[i / 3 * 3 + 1] * a[3 + i % 3] +
               by[i / 3 * 3 + 2] * a[6 + i % 3];
}

/* Makes a camera at the part u of the way from a to b, with the lens of a. */
static void place(saga_source_view *out, const saga_source_view *a,
                  const saga_source_view *b, double u)
{
    double from[3], to[3];

    memset(out, 0, sizeof *out);
    out->width = a->width;
    out->height = a->height;
    out->fx = a->fx;
    out->fy = a->fy;
    out->cx = a->cx;
    out->cy = a->cy;
    turn(out->rotation, a->rotation, b->rotation, u);
    saga_source_view_centre(from, a);
    saga_source_view_centre(to, b);
    /* The translation of world to camera is t = -R c. */
    for (int i = 0; i < 3; i++)
        for (int k = 0; k < 3; k++)
            out->translation[i] -= out->rotation[3 * i + k] *
                                   (from[k] + u * (to[k] - from[k]));
}

/* Finds the nearest views of training view k, as indices into p->train; between
 * equals the first wins. Returns their number, or 0 if the nearest one is so
 * close that k needs no help. */
static int find_neighbours(int near[N_NEIGHBOURS], const saga_pictures *p,
                           int k)
{
    double far[N_NEIGHBOURS];
    int n = 0;

    for (int i = 0; i < p->n_train; i++) {
        const double d = i == k ? INFINITY
                                : saga_view_angle(p, p->train[k], p->train[i]);

        if (d < MOST_ANGLE)
            n = saga_nearest_add(near, far, n, N_NEIGHBOURS, i, d);
    }
    return n > 0 && far[0] > LEAST_ANGLE ? n : 0;
}

static bool is_neighbour(const saga_pictures *p, int k, int i)
{
    int near[N_NEIGHBOURS];
    const int n = find_neighbours(near, p, k);
    bool found = false;

    for (int j = 0; j < n; j++)
        found = found || near[j] == i;
    return found;
}

/* Places cameras between view k and its neighbours. A mutual pair gets cameras
 * only from its first view. Returns whether there are neighbours. */
static bool place_around(saga_novel *o, const saga_pictures *p, int k)
{
    int near[N_NEIGHBOURS];
    const int n = find_neighbours(near, p, k);

    for (int j = 0; j < n; j++) {
        const int v = p->train[k], w = p->train[near[j]];

        if (near[j] < k && is_neighbour(p, near[j], k))
            continue;
        for (int i = 0; i < N_BETWEEN; i++) {
            place(&o->view[o->n_views], &p->capture->views[v],
                  &p->capture->views[w], (i + 0.5) / N_BETWEEN);
            o->nearest[o->n_views++] = fmin(p->range[2 * v], p->range[2 * w]);
        }
    }
    return n > 0;
}

bool saga_novel_init(saga_novel *o, const saga_pictures *p, saga_error *error)
{
    const size_t most = (size_t)p->n_train * N_NEIGHBOURS * N_BETWEEN;
    int n_helped = 0;

    memset(o, 0, sizeof *o);
    o->view = saga_calloc(most, sizeof *o->view, what, error);
    o->nearest = saga_calloc(most, sizeof *o->nearest, what, error);
    o->part = p->capture->n_frames > 1 ? MOVING_PART : STILL_PART;
    for (int k = 0; o->view && o->nearest && k < p->n_train; k++)
        n_helped += place_around(o, p, k);
    /* Where most views are near another one, the rest gain nothing either; and
     * where most are far from all others, too little is between cameras. */
    if (2 * n_helped < p->n_train)
        o->n_views = 0;
    if (o->view && o->nearest &&
        (o->n_views == 0 || saga_pictures_canvas(&o->canvas, p, error)))
        return true;
    saga_novel_free(o);
    return false;
}

void saga_novel_free(saga_novel *novel)
{
    for (int k = 0; k < novel->n_teachers; k++)
        saga_params_free(&novel->teacher[k]);
    free(novel->view);
    free(novel->nearest);
    saga_canvas_free(&novel->canvas);
    memset(novel, 0, sizeof *novel);
}

/* --- Teachers ------------------------------------------------------------ */

bool saga_novel_teach(saga_novel *o, const saga_splat_params *params,
                      uint32_t n, saga_error *error)
{
    o->n[o->n_teachers] = n;
    return saga_params_gather(&o->teacher[o->n_teachers++], params, NULL, n,
                              error);
}

static void walk_teacher(saga_novel *o, int k, uint32_t most,
                         saga_checkpoint *c, saga_error *error)
{
    saga_splat_params *const p = &o->teacher[k];
    /* All drawn primitives have the attributes that do not depend on time. */
    const uint64_t least = saga_attrs_of_tools(0, true);
    uint64_t head[2] = { o->n[k], saga_attrs_of(p) };

    saga_checkpoint_walk(c, head, sizeof head);
    if (c->reading) {
        /* Bounds are checked before anything is allocated. */
        if (head[0] < 1 || head[0] > most || head[1] > SAGA_ATTRS_ALL ||
            (head[1] & least) != least)
            c->failed = true;
        if (c->failed ||
            !saga_params_alloc(p, (uint32_t)head[1], (size_t)head[0], error)) {
            c->failed = true;
            return;
        }
        o->n[k] = (uint32_t)head[0];
    }
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (p->of[a])
            saga_checkpoint_walk(c, p->of[a],
                                 (size_t)o->n[k] *
                                     (size_t)saga_attributes[a].width *
                                     sizeof(real));
}

void saga_novel_walk(saga_novel *novel, uint32_t most_primitives,
                     saga_checkpoint *checkpoint, saga_error *error)
{
    uint64_t n = (uint64_t)novel->n_teachers;

    saga_checkpoint_walk(checkpoint, &n, sizeof n);
    if (n > SAGA_NOVEL_MOST_TEACHERS)
        checkpoint->failed = true;
    for (int k = 0; !checkpoint->failed && k < (int)n; k++) {
        /* A teacher that is only partly read is freed with the others. */
        if (checkpoint->reading)
            novel->n_teachers = k + 1;
        walk_teacher(novel, k, most_primitives, checkpoint, error);
    }
}

/* --- Pictures ------------------------------------------------------------ */

saga_sample saga_novel_pick(const saga_pictures *p, saga_rng rng, uint64_t draw)
{
    /* n is the number of teachers' pictures before this one. This picture is a
     * teacher's if the number grows with it. */
    const double part = p->novel ? p->novel->part : 0;
    const uint64_t n = (uint64_t)((double)draw * part);
    const uint64_t next = (uint64_t)((double)(draw + 1) * part);
    const saga_rng r = saga_rng_stream(rng.key, STREAM_NOVEL);
    saga_sample sample = { 0 };

    if (n == next)
        return saga_pictures_pick(p, rng, draw - n);
    sample.view = p->capture->n_views +
                  (int)saga_rng_below(r, 2 * n, (uint32_t)p->novel->n_views);
    sample.frame = (int)saga_rng_below(r, 2 * n + 1,
                                       (uint32_t)p->capture->n_frames);
    saga_pictures_set_behind(&sample, p, r, n);
    return sample;
}

/* Sets the truth of an aimed canvas to the mean of what the teachers draw,
 * clipped to 0..1. */
static bool draw_mean(saga_canvas *canvas, saga_novel *o, saga_error *error)
{
    saga_canvas *const c = &o->canvas;
    const size_t n = 3 * (size_t)canvas->camera.width *
                     (size_t)canvas->camera.height;

    c->camera = canvas->camera;
    c->t = canvas->t;
    memset(canvas->truth, 0, n * sizeof *canvas->truth);
    for (int k = 0; k < o->n_teachers; k++) {
        if (!saga_splat_forward(c, &o->teacher[k], o->n[k], error))
            return false;
        for (size_t i = 0; i < n; i++)
            canvas->truth[i] += saga_clamp(c->image[i], 0, 1) /
                                R(o->n_teachers);
    }
    canvas->n_unseen = 0;
    return true;
}

bool saga_novel_show(saga_canvas *canvas, const saga_pictures *p,
                     saga_sample sample, saga_error *error)
{
    saga_pictures_aim(canvas, p, sample);
    if (saga_novel_is(p, sample))
        return draw_mean(canvas, p->novel, error);
    saga_pictures_truth(canvas, p, sample);
    return true;
}
