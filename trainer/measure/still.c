/* SPDX-License-Identifier: MIT */
#include "still.h"

#include "alloc.h"
#include "change.h"
#include "verdict.h"

#include <stdlib.h>
#include <string.h>

static const char what[] = "still pictures";

static int n_pictures(int n_frames)
{
    return n_frames < SAGA_STILL_PICTURES ? n_frames : SAGA_STILL_PICTURES;
}

/* Returns the frame of picture i of those that are used. */
static int frame_at(int i, int n_frames)
{
    const int n = n_pictures(n_frames);

    /* The middles of n equal intervals: floor((i + 1/2) n_frames / n). */
    return (int)((2 * (int64_t)i + 1) * n_frames / (2 * n));
}

/* Returns the bytes of a view's pictures, and of their masks if it has any. */
static size_t view_nbytes(const saga_source_view *v, int n)
{
    const size_t size = (size_t)v->width * (size_t)v->height;

    return (size_t)n * size * (v->mask ? 4 : 3);
}

/* Makes room for the pictures of all views: in a file if those of the part are
 * in one, since there are too many for memory. */
static bool make_room(saga_still *s, const saga_capture *part, int n,
                      saga_error *error)
{
    size_t nbytes = 0;

    for (int v = 0; v < part->n_views; v++)
        nbytes += view_nbytes(&part->views[v], n);
    if (part->pixels.at && s->folder) {
        if (saga_scratch_make(&s->file, s->folder, nbytes, error))
            s->room = s->file.at;
    } else
        s->room = saga_calloc(nbytes, 1, what, error);
    return s->room != NULL;
}

/* Makes a view of n pictures at `room`. */
static void begin_view(saga_source_view *to, const saga_source_view *from,
                       int n, uint8_t *room)
{
    *to = saga_view_bare(from);
    to->rgb = room;
    to->mask = from->mask ? room + (size_t)n * saga_view_frame_nbytes(from)
                          : NULL;
}

static bool begin_still(saga_still *s, const saga_capture *part, int n_frames,
                        saga_error *error)
{
    const size_t n = (size_t)part->n_views;
    saga_capture *const c = &s->capture;
    uint8_t *room;

    /* The new capture has the part's properties, but pictures and points of its
     * own. */
    *c = *part;
    c->n_frames = n_pictures(n_frames);
    c->notes[0] = '\0';
    c->points = NULL;
    c->pixels = (saga_scratch){ NULL, 0, -1 };
    c->room = NULL;
    c->n_views = 0;
    c->views = saga_calloc(n, sizeof *c->views, what, error);
    s->seen = saga_calloc(n, sizeof *s->seen, what, error);
    if (part->n_points)
        c->points = saga_alloc(part->n_points, sizeof *c->points, what, error);
    if (!c->views || !s->seen || (part->n_points && !c->points) ||
        !make_room(s, part, c->n_frames, error))
        return false;
    if (part->n_points)
        memcpy(c->points, part->points, part->n_points * sizeof *c->points);
    room = s->room;
    for (; c->n_views < part->n_views; c->n_views++) {
        const saga_source_view *const from = &part->views[c->n_views];

        begin_view(&c->views[c->n_views], from, c->n_frames, room);
        room += view_nbytes(from, c->n_frames);
    }
    return true;
}

static void take(saga_still *s, const saga_capture *part, int view, int frame)
{
    const saga_source_view *const to = &s->capture.views[view];
    const size_t nbytes = saga_view_frame_nbytes(to);
    const uint8_t *const mask = saga_capture_mask(part, view, frame);

    memcpy(to->rgb + nbytes * (size_t)s->n,
           saga_capture_frame(part, view, frame), nbytes);
    if (to->mask && mask)
        memcpy(to->mask + nbytes / 3 * (size_t)s->n, mask, nbytes / 3);
    s->seen[view] = s->seen[view] || saga_capture_has(part, view, frame);
}

bool saga_still_add(saga_still *s, const saga_capture *part, int first,
                    int n_frames, saga_error *error)
{
    const saga_capture *const c = &s->capture;

    if (!c->views && !begin_still(s, part, n_frames, error))
        return false;
    if (part->n_views != c->n_views)
        return saga_fail(error, NULL,
                         "give a longer --segment, or leave those "
                         "cameras out",
                         "%d cameras have pictures from frame "
                         "%d on, %d before",
                         part->n_views, first, c->n_views);
    /* Takes the frames that lie in this part; later parts hold the rest. */
    while (s->n < c->n_frames) {
        const int at = frame_at(s->n, n_frames);

        if (at >= first + part->n_frames)
            break;
        for (int v = 0; v < c->n_views; v++)
            take(s, part, v, at - first);
        s->n++;
    }
    return true;
}

/* Returns whether pixel i of n pictures is steadily near the median. Pictures
 * that a mask excludes have the colour of the nearest picture that counts, so
 * one picture that counts is enough. */
static bool is_steady(const saga_source_view *v, const uint8_t *median,
                      size_t i, int n)
{
    const size_t size = saga_view_frame_nbytes(v) / 3;
    int near = 0, counts = v->mask == NULL;

    for (size_t k = 0; k < (size_t)n; k++) {
        const uint8_t *const rgb = v->rgb + 3 * (k * size + i);
        bool is_near = true;

        for (size_t c = 0; c < 3; c++)
            is_near = is_near &&
                      abs(rgb[c] - median[3 * i + c]) <= SAGA_CHANGE_LEVEL;
        near += is_near;
        counts |= v->mask && v->mask[k * size + i];
    }
    /* Three quarters of them: something that is seen more rarely may hide what
     * is behind. */
    return counts && 4 * near >= 3 * n;
}

/* Replaces the pictures by the median and a mask; sets no mask if all pixels
 * count. */
static bool finish_pictures(saga_source_view *v, uint8_t *median, int n,
                            saga_error *error)
{
    const size_t size = saga_view_frame_nbytes(v) / 3;
    uint8_t *mask = saga_alloc(size, 1, what, error);
    size_t steady = 0;

    for (size_t i = 0; mask && i < size; i++)
        steady += mask[i] = is_steady(v, median, i, n);
    if (steady == size) {
        free(mask);
        mask = NULL;
    }
    v->rgb = median;
    v->mask = mask;
    return !saga_failed(error);
}

static bool finish_view(saga_still *s, int view, saga_error *error)
{
    saga_capture *const c = &s->capture;
    saga_source_view *const v = &c->views[view];
    uint8_t *const median = saga_verdict_median(c, view, error);

    if (!median)
        return false;
    s->n_finished++;
    if (!finish_pictures(v, median, c->n_frames, error))
        return false;
    c->picture_nbytes += view_nbytes(v, 1);
    if (s->seen[view])
        return true;
    /* No part had a picture of this view, so there is no median: it is marked
     * as missing. */
    v->n_missing = 1;
    v->missing = saga_alloc(1, sizeof *v->missing, what, error);
    if (v->missing)
        *v->missing = true;
    return v->missing != NULL;
}

bool saga_still_finish(saga_capture *capture, saga_still *s, saga_error *error)
{
    saga_capture *const c = &s->capture;

    c->picture_nbytes = 0;
    for (int v = 0; v < c->n_views; v++)
        if (!finish_view(s, v, error))
            return false;
    c->n_frames = 1;
    *capture = *c;
    *c = (saga_capture){ 0 };
    saga_still_free(s);
    return true;
}

void saga_still_free(saga_still *s)
{
    /* Views that are not finished have no pictures of their own. */
    for (int v = s->n_finished; v < s->capture.n_views; v++)
        s->capture.views[v].rgb = s->capture.views[v].mask = NULL;
    saga_capture_free(&s->capture);
    if (s->file.at)
        saga_scratch_free(&s->file);
    else
        free(s->room);
    free(s->seen);
    memset(s, 0, sizeof *s);
}
