/* SPDX-License-Identifier: MIT */
#include "pictures.h"

#include "alloc.h"

#include <limits.h>
#include <stdlib.h>
#include <string.h>

static const char what[] = "the views";

/* All members are multiples of eight bytes, so there is no padding. */
typedef struct {
    uint64_t n_views, n_frames;
    double fps, metres;
    saga_cube cube;
    double background[3];
} head;

typedef struct {
    char name[SAGA_NAME_NBYTES];
    int64_t width, height, held_out, n_missing;
    double fx, fy, cx, cy;
    double rotation[9], translation[3];
    double range[2];
} kept_view;

static void save_view(const saga_pictures *p, int view, saga_checkpoint *c)
{
    const saga_source_view *const v = &p->capture->views[view];
    kept_view k = { .width = v->width,
                    .height = v->height,
                    .held_out = v->held_out,
                    .n_missing = v->n_missing,
                    .fx = v->fx,
                    .fy = v->fy,
                    .cx = v->cx,
                    .cy = v->cy,
                    .range = { p->range[2 * view], p->range[2 * view + 1] } };

    memcpy(k.name, v->name, sizeof k.name);
    memcpy(k.rotation, v->rotation, sizeof k.rotation);
    memcpy(k.translation, v->translation, sizeof k.translation);
    saga_checkpoint_walk(c, &k, sizeof k);
}

void saga_pictures_save(const saga_pictures *p, saga_checkpoint *c)
{
    head h = { (uint64_t)p->capture->n_views,
               (uint64_t)p->capture->n_frames,
               p->capture->fps,
               p->capture->metres,
               p->cube,
               { 0 } };

    for (int k = 0; k < 3; k++)
        h.background[k] = p->background[k];
    saga_checkpoint_walk(c, &h, sizeof h);
    for (int v = 0; v < p->capture->n_views; v++)
        save_view(p, v, c);
}

/* Reads a view, and lists it if it is a training view. */
static bool take_view(saga_pictures *p, saga_source_view *v, int view,
                      saga_checkpoint *c)
{
    kept_view k;

    saga_checkpoint_walk(c, &k, sizeof k);
    /* The file may be from anybody, so sizes are checked before they are
     * used. */
    if (k.width < 1 || k.width > SAGA_MAX_SIDE || k.height < 1 ||
        k.height > SAGA_MAX_SIDE || k.n_missing < 0 ||
        k.n_missing > p->capture->n_frames)
        c->failed = true;
    if (c->failed)
        return false;
    *v = (saga_source_view){ .width = (int)k.width,
                             .height = (int)k.height,
                             .held_out = k.held_out != 0,
                             .fx = k.fx,
                             .fy = k.fy,
                             .cx = k.cx,
                             .cy = k.cy,
                             .n_missing = (int)k.n_missing };
    /* The last byte stays 0, whatever the file has. */
    memcpy(v->name, k.name, sizeof v->name - 1);
    memcpy(v->rotation, k.rotation, sizeof v->rotation);
    memcpy(v->translation, k.translation, sizeof v->translation);
    memcpy(p->range + 2 * view, k.range, sizeof k.range);
    if (!v->held_out && v->n_missing < p->capture->n_frames)
        p->train[p->n_train++] = view;
    return true;
}

static bool alloc_views(saga_pictures *p, saga_capture *capture, size_t n,
                        saga_error *error)
{
    capture->views = saga_calloc(n, sizeof *capture->views, what, error);
    p->range = saga_calloc(2 * n, sizeof *p->range, what, error);
    p->train = saga_calloc(n, sizeof *p->train, what, error);
    p->exposure = saga_alloc(3 * n, sizeof *p->exposure, what, error);
    for (size_t i = 0; p->exposure && i < 3 * n; i++)
        p->exposure[i] = 1;
    capture->n_views = capture->views ? (int)n : 0;
    return !saga_failed(error);
}

bool saga_pictures_restore(saga_pictures *p, saga_capture *capture,
                           saga_checkpoint *c, saga_error *error)
{
    head h;

    *capture = (saga_capture){ 0 };
    memset(p, 0, sizeof *p);
    p->capture = capture;
    saga_checkpoint_walk(c, &h, sizeof h);
    /* The counts are checked before memory is allocated for them. */
    if (h.n_views < 1 || h.n_views > UINT16_MAX || h.n_frames < 1 ||
        h.n_frames > UINT16_MAX)
        c->failed = true;
    if (c->failed || !alloc_views(p, capture, (size_t)h.n_views, error))
        return false;
    capture->n_frames = (int)h.n_frames;
    capture->fps = h.fps;
    capture->metres = h.metres;
    p->cube = h.cube;
    for (int k = 0; k < 3; k++)
        p->background[k] = (uint8_t)h.background[k];
    for (int v = 0; v < capture->n_views; v++)
        if (!take_view(p, &capture->views[v], v, c))
            return false;
    /* Frames that a view lacks are not known here, so all count. */
    c->failed = (int64_t)p->n_train * capture->n_frames > INT_MAX;
    p->n_there = c->failed ? 0 : p->n_train * capture->n_frames;
    return p->n_there > 0;
}
