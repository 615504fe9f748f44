/* SPDX-License-Identifier: MIT */
#include "miniature.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>

/* About the pixels of a picture, those of 80 x 45, and its least side. */
enum { AREA = 3600, LEAST_SIDE = 8 };

static const char what[] = "small pictures";

/* Returns the side of the boxes of pixels that become one. */
static int box_of(const saga_source_view *v)
{
    const int shorter = v->width < v->height ? v->width : v->height;
    const double box = rint(sqrt((double)v->width * v->height / AREA));

    return (int)fmax(fmin(box, shorter / LEAST_SIDE), 1);
}

static bool has_view(const saga_capture *c, int view)
{
    const saga_source_view *const v = &c->views[view];

    return !v->held_out && v->n_missing < c->n_frames;
}

static size_t pixels_of(const saga_source_view *v)
{
    const int box = box_of(v);

    return (size_t)(v->width / box) * (size_t)(v->height / box);
}

double saga_miniature_pixels(const saga_capture *c, int *n_views)
{
    double n = 0;

    *n_views = 0;
    for (int i = 0; i < c->n_views; i++)
        if (has_view(c, i)) {
            n += (double)pixels_of(&c->views[i]);
            ++*n_views;
        }
    return n;
}

/* Sets each value of a small picture, which has n values in each pixel, to the
 * mean of its box. It is rounded down, so that a pixel of a mask of zeros and
 * ones counts only if its whole box does. */
static void reduce(uint8_t *to, const saga_source_view *small,
                   const uint8_t *from, const saga_source_view *whole, size_t n)
{
    const size_t box = (size_t)box_of(whole), stride = n * (size_t)whole->width;
    const size_t row = n * (size_t)small->width;

    for (size_t i = 0; i < row * (size_t)small->height; i++) {
        const uint8_t *at = from + i / row * box * stride +
                            i % row / n * box * n + i % n;
        size_t sum = 0;

        for (size_t y = 0; y < box; y++, at += stride)
            for (size_t x = 0; x < box; x++)
                sum += at[n * x];
        to[i] = (uint8_t)(sum / (box * box));
    }
}

/* Makes a view whose picture, and mask if there is one, begin at `room`. */
static void make_view(saga_source_view *to, const saga_capture *c, int view,
                      uint8_t *room)
{
    const saga_source_view *const from = &c->views[view];
    const int frame = saga_capture_near(c, view, c->n_frames / 2);
    const uint8_t *const mask = saga_capture_mask(c, view, frame);
    const int box = box_of(from);

    *to = saga_view_bare(from);
    /* Coordinates start at the picture's corner. Pixels that do not fill a box
     * are left out. */
    to->width /= box;
    to->height /= box;
    to->fx /= box;
    to->fy /= box;
    to->cx /= box;
    to->cy /= box;
    to->late = 0;
    to->rgb = room;
    to->mask = mask ? room + saga_view_frame_nbytes(to) : NULL;
    reduce(to->rgb, to, saga_capture_frame(c, view, frame), from, 3);
    if (mask)
        reduce(to->mask, to, mask, from, 1);
}

bool saga_miniature_make(saga_miniature *m, const saga_capture *c,
                         saga_error *error)
{
    const size_t n = (size_t)c->n_views;
    uint8_t *room;
    int n_views;

    *m = (saga_miniature){ .capture = *c };
    m->capture.n_frames = 1;
    m->capture.n_views = 0;
    m->capture.pixels = (saga_scratch){ NULL, 0, -1 };
    m->capture.room = NULL;
    m->capture.views = saga_calloc(n, sizeof *m->capture.views, what, error);
    m->view = saga_alloc(n, sizeof *m->view, what, error);
    /* Three bytes for a pixel, and one for its mask. */
    m->room = saga_alloc((size_t)saga_miniature_pixels(c, &n_views), 4, what,
                         error);
    room = m->room;
    if (!m->capture.views || !m->view || !room)
        return false;
    for (int i = 0; i < c->n_views; i++)
        if (has_view(c, i)) {
            m->view[m->capture.n_views] = i;
            make_view(&m->capture.views[m->capture.n_views++], c, i, room);
            room += 4 * pixels_of(&c->views[i]);
        }
    return true;
}

void saga_miniature_free(saga_miniature *m)
{
    free(m->capture.views);
    free(m->view);
    free(m->room);
    *m = (saga_miniature){ .room = NULL };
}
