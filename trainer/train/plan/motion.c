/* SPDX-License-Identifier: MIT
 *
 * Measures the rule of motion.h on the warm-up.
 */
#include "motion.h"

#include "alloc.h"

#include <stdlib.h>

#define CHANGE 8 /* levels of 255 */
#define CHANGING_PART 1e-4
#define EXPLAINED 0.1
enum {
    N_VIEWS = 8,
    N_FRAMES = 8
}; /* the largest numbers of views and frames
    * that are sampled */

/* Sums over the pixels that change. */
typedef struct {
    double change, left;
    double changing, pixels;
} tally;

/* The warm-up, and the pictures on which it is measured. */
typedef struct {
    saga_flat *flat;
    const saga_pictures *pictures;
} asked;

static bool changes(const uint8_t *a, const uint8_t *b)
{
    return abs(a[0] - b[0]) > CHANGE || abs(a[1] - b[1]) > CHANGE ||
           abs(a[2] - b[2]) > CHANGE;
}

/* The guess for a camera that moves, of which no two pictures show the same
 * view. */
#define CHANGE_UNKNOWN 0.1

double saga_plan_change(const saga_capture *c)
{
    const int n = c->n_frames < N_FRAMES ? c->n_frames : N_FRAMES;
    double changing = 0, pixels = 0;

    if (c->moves)
        return CHANGE_UNKNOWN;

    for (int v = 0; v < c->n_views; v++) {
        const size_t size = saga_view_frame_nbytes(&c->views[v]);
        const uint8_t *middle;

        /* Held-out pictures count for nothing, and need not be read. */
        if (c->views[v].held_out)
            continue;
        middle = saga_capture_frame(c, v, c->n_frames / 2);
        for (int i = 0; i < n; i++) {
            const uint8_t *const now = saga_capture_frame(
                c, v, (int)((int64_t)i * c->n_frames / n));

            /* Pixels are R, G, B; a change of one channel is enough. */
            for (size_t at = 0; at < size; at += 3)
                changing += changes(now + at, middle + at);
            pixels += (double)(size / 3);
        }
    }
    return pixels > 0 ? changing / pixels : 0;
}

static void count_pixel(tally *sum, const uint8_t *now, const uint8_t *middle,
                        const real *drawn, const real *drawn_middle,
                        size_t plane)
{
    for (size_t k = 0; k < 3; k++) {
        /* Both changes are against the middle frame, so that errors that the
         * drawn pictures share cancel. */
        const double want = (now[k] - middle[k]) / 255.0;
        const double have = (double)(drawn[k * plane] -
                                     drawn_middle[k * plane]);

        sum->change += want * want;
        sum->left += (want - have) * (want - have);
    }
    sum->changing++;
}

static void count(tally *sum, const saga_capture *c, int view, int frame,
                  const real *drawn, const real *drawn_middle)
{
    const saga_source_view *const v = &c->views[view];
    const size_t n = (size_t)v->width * (size_t)v->height;
    const uint8_t *const now = saga_capture_frame(c, view, frame);
    const uint8_t *const middle = saga_capture_frame(c, view, c->n_frames / 2);

    sum->pixels += (double)n;
    for (size_t i = 0; i < n; i++)
        if (changes(now + 3 * i, middle + 3 * i))
            count_pixel(sum, now + 3 * i, middle + 3 * i, drawn + i,
                        drawn_middle + i, n);
}

/* Adds one view to the tally. `pictures` has room for two pictures of the
 * largest view. */
static bool tally_view(tally *sum, const asked *a, int view, real *pictures,
                       saga_error *error)
{
    const saga_capture *const c = a->pictures->capture;
    const int n = c->n_frames < N_FRAMES ? c->n_frames : N_FRAMES;
    real *const drawn = pictures + 3 * saga_pictures_largest(a->pictures);
    saga_sample at = { .view = view, .frame = c->n_frames / 2 };
    double mse;

    /* The middle frame stays in the first picture; each other frame is drawn
     * into the second. */
    if (!saga_flat_render(a->flat, pictures, &mse, at, error))
        return false;
    for (int i = 0; i < n; i++) {
        at.frame = (int)((int64_t)i * c->n_frames / n);
        if (!saga_flat_render(a->flat, drawn, &mse, at, error))
            return false;
        count(sum, c, view, at.frame, drawn, pictures);
    }
    return true;
}

static bool tally_views(tally *sum, const asked *a, saga_error *error)
{
    const saga_pictures *const p = a->pictures;
    real *const pictures = saga_alloc(6 * saga_pictures_largest(p),
                                      sizeof *pictures, "two pictures", error);
    bool ok = pictures != NULL;

    for (int i = 0; i < p->n_train && ok; i++)
        /* Every (n_train / N_VIEWS)th training view is measured. */
        if (p->n_train <= N_VIEWS || (i * N_VIEWS) % p->n_train < N_VIEWS)
            ok = tally_view(sum, a, p->train[i], pictures, error);
    free(pictures);
    return ok;
}

bool saga_plan_motion(saga_motion_found *found, saga_flat *flat,
                      const saga_pictures *pictures, saga_train_motion motion,
                      saga_error *error)
{
    const asked a = { flat, pictures };
    tally sum = { 0, 0, 0, 0 };

    /* There is nothing to decide if temporal tools are off already or were
     * asked for, and nothing to measure if the camera moves: no two pictures
     * show the same view. */
    if (!found->moves || motion == SAGA_TRAIN_MOVING ||
        pictures->capture->moves)
        return true;
    if (!tally_views(&sum, &a, error))
        return false;
    found->changing = sum.changing / sum.pixels;
    found->explained = sum.change > 0 ? 1 - sum.left / sum.change : 0;
    /* Camera noise changes pixels too, but the warm-up hardly explains it
     * (motion.h). */
    found->moves = found->changing >= CHANGING_PART &&
                   found->explained >= EXPLAINED;
    return true;
}
