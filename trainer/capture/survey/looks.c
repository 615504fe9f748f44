/* SPDX-License-Identifier: MIT */
#include "looks.h"

#include "alloc.h"
#include "lateness.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>

enum {
    MOMENTS = 3,     /* pictures of a camera that are looked at */
    ROWS = 64,       /* rows of a picture that are looked at */
    DETAIL_STEP = 4, /* pixels */
    STEPS = 48,      /* most steps between pictures that are compared */
    FEW_STEPS = 4,
    CHANGE_PIXELS = 7 /* every seventh pixel is compared */
};

/* Levels between the 2nd and the 98th part of a hundred of a picture's pixels;
 * one that shows less than this is blank. A lens cap in the dark has noise of a
 * few levels, a foggy landscape has 30. */
#define CONTRAST 12.0
/* A camera stands still in a step if it changes by less than this part of what
 * the median camera does. Coding again changes pictures that stand still by a
 * little; the noise of a camera that sees nothing move is a third or more of
 * what others show. */
#define STILL 0.05
/* Mean change in levels of the median camera, for a step to count. */
#define SOME_CHANGE 0.1

/* Sums over pixels of a picture: of green, of its squares, of the products of
 * neighbours, and of squares of second differences at both distances. */
typedef struct sums {
    double n, a, aa, ab, near, far;
} sums;

/* Adds a row of green to the sums, and its pixels to the histogram. */
static void add_row(sums *to, size_t *histogram, const uint8_t *rgb,
                    const uint8_t *mask, int width)
{
    for (int x = DETAIL_STEP; x + DETAIL_STEP < width; x++) {
        const uint8_t *const at = rgb + 3 * x + 1;
        const double a = *at, b = at[3], near = at[-3] - 2.0 * a + b;
        const double far = at[-3 * DETAIL_STEP] - 2.0 * a + at[3 * DETAIL_STEP];
        if (mask &&
            !(mask[x - DETAIL_STEP] && mask[x] && mask[x + DETAIL_STEP]))
            continue;
        histogram[*at]++;
        to->n++;
        to->a += a;
        to->aa += a * a;
        to->ab += a * b;
        to->near += near * near;
        to->far += far * far;
    }
}

/* Returns the level below which a part q of n pixels lie. */
static int level_at(const size_t *histogram, double n, double q)
{
    double sum = 0.0;
    int level = 0;
    while (level < 255 && (sum += (double)histogram[level]) <= q * n)
        level++;
    return level;
}

/* Adds one picture to a look. */
static void look_at(saga_look *look, sums *all, const saga_capture *c, int v,
                    int frame)
{
    const saga_source_view *const s = &c->views[v];
    const uint8_t *const rgb = saga_capture_frame(c, v, frame);
    const uint8_t *const mask = saga_capture_mask(c, v, frame);
    const int step = s->height / ROWS + 1;
    size_t histogram[256] = { 0 };
    sums own = { 0 };
    for (int y = 0; y < s->height; y += step)
        add_row(&own, histogram, rgb + (size_t)y * saga_view_row_nbytes(s),
                mask ? mask + (size_t)y * (size_t)s->width : NULL, s->width);
    if (own.n == 0.0)
        return;
    /* A picture is blank if nearly all of its pixels have the same level. */
    const bool blank = level_at(histogram, own.n, 0.98) -
                           level_at(histogram, own.n, 0.02) <
                       CONTRAST;
    if (blank || look->n_blank == 0)
        look->level = level_at(histogram, own.n, 0.5);
    look->n_seen++;
    look->n_blank += blank;
    if (blank)
        return;
    all->n += own.n;
    all->a += own.a;
    all->aa += own.aa;
    all->ab += own.ab;
    all->near += own.near;
    all->far += own.far;
}

static void look_at_view(saga_look *look, const saga_capture *c, int v)
{
    const int n = c->views[v].single ? 1 : MOMENTS;
    sums all = { 0 };
    int last = -1;
    *look = (saga_look){ .alike = (double)NAN,
                         .detail = (double)NAN,
                         .still = (double)NAN };
    /* The first picture, the middle and the last, each once. */
    for (int i = 0; i < n; i++) {
        const int k = saga_capture_near(c, v,
                                        i * (c->n_frames - 1) / (MOMENTS - 1));
        if (k != last)
            look_at(look, &all, c, v, k);
        last = k;
    }
    const double variance = all.aa - all.a * all.a / fmax(all.n, 1.0);
    if (variance > 0.0)
        look->alike = (all.ab - all.a * all.a / all.n) / variance;
    if (all.far > 0.0)
        look->detail = sqrt(all.near / all.far);
}

/* Sets `still` of all views. change (n_views) and sorted (n_views) are scratch
 * memory; counts (n_views) begins as 0. */
static void find_still(saga_look *looks, const saga_capture *c, double *change,
                       double *sorted, int *counts)
{
    const int n = c->n_frames - 1, n_views = c->n_views;
    const int step = n / STEPS + 1;
    int n_steps = 0;
    for (int k = 0; k < n; k += step) {
        int n_there = 0;
        for (int v = 0; v < n_views; v++) {
            const double pixels = (double)saga_view_frame_nbytes(&c->views[v]) /
                                  (3.0 * CHANGE_PIXELS);
            const bool there = saga_capture_has(c, v, k) &&
                               saga_capture_has(c, v, k + 1);
            change[v] = there ? saga_change_at(c, v, k, CHANGE_PIXELS) / pixels
                              : (double)NAN;
            if (there)
                sorted[n_there++] = change[v];
        }
        /* A step counts if half of the views have it and something moves. */
        const double typical = saga_median(sorted, (size_t)n_there);
        if (2 * n_there < n_views || !(typical >= SOME_CHANGE))
            continue;
        n_steps++;
        for (int v = 0; v < n_views; v++)
            counts[v] += change[v] < STILL * typical;
    }
    for (int v = 0; v < n_views && n_steps >= FEW_STEPS; v++)
        looks[v].still = (double)counts[v] / n_steps;
}

bool saga_looks_find(saga_look *looks, const saga_capture *capture,
                     saga_error *error)
{
    const size_t n = (size_t)capture->n_views;
    double *const change = saga_alloc(2 * n, sizeof *change, "the pictures",
                                      error);
    int *const counts = saga_calloc(n, sizeof *counts, "the pictures", error);
    const bool ok = change && counts;
#pragma omp parallel for schedule(dynamic) if (ok)
    for (int v = 0; v < (ok ? capture->n_views : 0); v++)
        look_at_view(&looks[v], capture, v);
    /* With two cameras nobody knows which of them is right. */
    if (ok && n > 2 && !capture->moves)
        find_still(looks, capture, change, change + n, counts);
    free(change);
    free(counts);
    return ok;
}
