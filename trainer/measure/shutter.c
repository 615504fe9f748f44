/* SPDX-License-Identifier: MIT */
#include "shutter.h"

#include "alloc.h"
#include "order.h"

#include <math.h>
#include <stdlib.h>

enum {
    MOVES = 6,              /* least change between the two drawn pictures, in
                             * 8-bit levels: well above rounding */
    FEW_PICTURES = 4
};

/* Thresholds that no camera of a capture without a rolling shutter came near to
 * exceeding both. */
#define LEAST_READOUT 0.25  /* frames */
#define LEAST_SPREADS 4.0

/* --- Sums ---------------------------------------------------------------- */

static void add_sums(saga_shutter_sums *to, const saga_shutter_sums *from,
                     double factor)
{
    to->dd += factor * from->dd;
    to->ds += factor * from->ds;
    to->ss += factor * from->ss;
    to->de += factor * from->de;
    to->se += factor * from->se;
}

static bool moves(const uint8_t *before, const uint8_t *after)
{
    return abs(after[0] - before[0]) >= MOVES ||
           abs(after[1] - before[1]) >= MOVES ||
           abs(after[2] - before[2]) >= MOVES;
}

void saga_shutter_add(saga_shutter *to, const uint8_t *truth,
                      const saga_shutter_drawn *drawn, int width, int height)
{
    saga_shutter_sums *const picture =
        &to->pictures[to->n_pictures++ % SAGA_SHUTTER_GROUPS];
    size_t p = 0;

    for (int y = 0; y < height; y++) {
        /* The height of the row's centre, -1/2 at the top and 1/2 at the
         * bottom. It has mean 0, so that a delay common to all rows does not
         * count as readout. */
        const double row = (y + 0.5) / height - 0.5;

        for (int x = 0; x < width; x++, p += 3) {
            saga_shutter_sums one = { .dd = 0 };

            if (!moves(drawn->before + p, drawn->after + p))
                continue;
            /* A row that was captured l frames late differs by l times the
             * change in a frame: e = (delay + readout x row) d. */
            for (size_t k = p; k < p + 3; k++) {
                const double d = drawn->after[k] - drawn->before[k];

                one.dd += d * d;
                one.de += d * (truth[k] - drawn->at[k]);
            }
            one.ds = row * one.dd;
            one.ss = row * one.ds;
            one.se = row * one.de;
            add_sums(picture, &one, 1);
            add_sums(&to->strips[x * SAGA_SHUTTER_GROUPS / width], &one, 1);
        }
    }
}

/* --- The fit ------------------------------------------------------------- */

/* Returns the readout: the coefficient of s in the least-squares fit of e by d
 * and s. NaN if too little moves. */
static double fit(const saga_shutter_sums *q)
{
    const double det = q->dd * q->ss - q->ds * q->ds;

    return det > 1e-9 * q->dd * q->ss
        ? (q->se * q->dd - q->de * q->ds) / det : (double)NAN;
}

/* Returns the variance of the fit by the jackknife over groups, because errors
 * of the film are correlated over many pixels. */
static double variance(const saga_shutter_sums *all,
                       const saga_shutter_sums *groups, int n)
{
    double sum = 0, squares = 0;

    for (int i = 0; i < n; i++) {
        saga_shutter_sums rest = *all;
        double x;

        add_sums(&rest, &groups[i], -1);
        /* x is the change of the result without group i; the variance is (n -
         * 1) / n times the sum of squares around the mean of x. */
        x = fit(&rest) - fit(all);
        sum += x;
        squares += x * x;
    }
    return (n - 1) * (squares - sum * sum / n) / n;
}

static saga_shutter_found find_alone(const saga_shutter *of)
{
    const int n = of->n_pictures < SAGA_SHUTTER_GROUPS ? of->n_pictures
                                                       : SAGA_SHUTTER_GROUPS;
    const saga_shutter_found unknown = { (double)NAN, (double)NAN, false };
    saga_shutter_sums all = { .dd = 0 };

    if (n < FEW_PICTURES)
        return unknown;
    for (int i = 0; i < SAGA_SHUTTER_GROUPS; i++)
        add_sums(&all, &of->strips[i], 1);
    /* Errors of the film persist in time or in place. Groups of pictures show
     * the first, groups of strips the second; the larger variance is used. */
    const double in_time = variance(&all, of->pictures, n);
    const double across = variance(&all, of->strips, SAGA_SHUTTER_GROUPS);
    if (isnan(in_time) || isnan(across))
        return unknown;
    return (saga_shutter_found){
        .readout = fit(&all), .spread = sqrt(fmax(fmax(in_time, across), 0))
    };
}

/* Returns the median readout. Moving things in the film are sheared as most
 * cameras see them, so readouts are relative to the median. */
static double median_readout(const saga_shutter_found *found, int n,
                             double *scratch)
{
    int known = 0;

    for (int i = 0; i < n; i++)
        if (!isnan(found[i].readout))
            scratch[known++] = found[i].readout;
    qsort(scratch, (size_t)known, sizeof *scratch, saga_by_value);
    return known ? 0.5 * (scratch[(known - 1) / 2] + scratch[known / 2]) : 0;
}

/* Decides which readouts are real. A camera with a long readout distorts the
 * film, and then its neighbours seem to have an opposite, smaller one. */
static void judge(saga_shutter_found *found, int n)
{
    double most = 0;

    for (int i = 0; i < n; i++) {
        /* First judge each camera by itself, then compare it with the largest
         * readout. */
        const double x = fabs(found[i].readout);

        found[i].shows = x >= LEAST_READOUT &&
                         x >= LEAST_SPREADS * found[i].spread;
        if (found[i].shows && x > most)
            most = x;
    }
    for (int i = 0; i < n; i++)
        if (fabs(found[i].readout) < 0.5 * most)
            found[i].shows = false;
}

saga_shutter_found *saga_shutter_find(const saga_shutter *of, int n,
                                      saga_error *error)
{
    double *const scratch = saga_alloc((size_t)n, sizeof *scratch,
                                       "the cameras", error);
    saga_shutter_found *const found =
        scratch ? saga_alloc((size_t)n, sizeof *found, "the cameras", error)
                : NULL;
    double usual;

    for (int i = 0; found && i < n; i++)
        found[i] = find_alone(&of[i]);
    usual = found ? median_readout(found, n, scratch) : 0;
    for (int i = 0; found && i < n; i++)
        found[i].readout -= usual;
    if (found)
        judge(found, n);
    free(scratch);
    return found;
}

/* --- Drawing ------------------------------------------------------------- */

/* Draws the film at a time in frames of the capture. Pixels that do not count
 * are set to the truth in every drawn picture, so that they do not move. */
static bool draw(uint8_t *rgb, saga_film *film, const saga_shutter_view *from,
                 int frame, double late, saga_error *error)
{
    const int whole = (int)floor(late);

    if (!saga_film_draw_late(film, &from->camera,
                             (uint32_t)(from->first + frame + whole),
                             late - whole, rgb, error))
        return false;
    saga_capture_forgive(from->capture, from->view, frame, rgb);
    return true;
}

static bool look_at(saga_shutter *to, saga_film *film,
                    const saga_shutter_view *from, int frame,
                    saga_error *error)
{
    const saga_shot *const v = &from->capture->views[from->view];
    const size_t n = saga_view_frame_nbytes(v);
    uint8_t *const rgb = saga_alloc(3, n, v->name, error);
    const saga_shutter_drawn drawn = { rgb, rgb + n, rgb + 2 * n };
    const bool ok = rgb &&
        /* Half a frame to both sides, so that the change is that of one frame,
         * centred on the picture's own time. */
        draw(rgb, film, from, frame, v->late - 0.5, error) &&
        draw(rgb + n, film, from, frame, v->late, error) &&
        draw(rgb + 2 * n, film, from, frame, v->late + 0.5, error);

    if (ok)
        saga_shutter_add(to, saga_capture_frame(from->capture, from->view,
                                                frame),
                         &drawn, v->width, v->height);
    free(rgb);
    return ok;
}

bool saga_shutter_look(saga_shutter *to, saga_film *film,
                       const saga_shutter_view *from, int n,
                       saga_error *error)
{
    /* Exclude the first frame and the last. */
    const int inner = from->capture->n_frames - 2;

    n = n < inner ? n : inner;
    for (int i = 0; i < n; i++) {
        const int frame = 1 + (int)((int64_t)i * inner / n);

        if (saga_capture_has(from->capture, from->view, frame) &&
            !look_at(to, film, from, frame, error))
            return false;
    }
    return true;
}
