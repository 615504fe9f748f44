/* SPDX-License-Identifier: MIT
 *
 * Measures how late cameras are by when things move. The row of a camera has a
 * number for each frame: the step in the logarithm of the change between
 * consecutive pictures. The logarithm keeps a close camera's motions from
 * dominating. The step makes changes that cameras do not share nearly
 * independent over time, so that the correlation of n unrelated numbers has a
 * standard deviation of 1 / sqrt(n).
 *
 * A row is shifted until it agrees best with the sum of the other rows. The
 * shift is reported if
 *   - the correlation is higher than chance explains,
 *   - no other shift, except the two neighbouring ones, comes near,
 *   - and it hardly changes if an eighth of the frames, or of the cameras, is
 *     left out: the spread of these results gives its standard error (the
 *     jackknife with groups).
 */
#include "lateness.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    MOST_LATE = 15, /* frames */
    N_SHIFTS = 2 * MOST_LATE + 1,
    FEW_FRAMES = 12,
    FEW_VIEWS = 3,
    GROUPS = 8 /* groups of frames, and groups of cameras */
};

/* The largest of 31 correlations of unrelated rows exceeds this number of
 * standard deviations in 0.1 % of all cases. */
#define SURE_AGREEMENT 4.0
/* The difference of two correlations has a standard deviation of sqrt(2 /
 * n). */
#define SURE_GAP 1.5
/* 95 % of the estimates from 8 groups lie within 2.4 standard errors (Student's
 * t with 7 degrees of freedom). LEAST_TOLERANCE is for the parabola's error. */
#define STANDARD_ERRORS 2.4
#define LEAST_TOLERANCE 0.1
/* Frames; with a larger tolerance the next frame may be the right one. */
#define MOST_TOLERANCE 0.5

typedef struct matcher {
    double *rows;         /* (n_views, n) */
    double *sum;          /* (n) sum of all rows */
    double *others;       /* (n) sum that a row is compared with */
    int n_views, n, most; /* shifts are -most to most */
} matcher;

double saga_lateness_likely(const saga_lateness *late)
{
    const double whole = nearbyint(late->frames);
    return fabs(late->frames - whole) <= late->tolerance ? whole : late->frames;
}

/* --------------------------------------------------------------------- rows */

/* Normalises a row to mean 0 and variance 1; a constant row becomes 0. */
static void normalise(double *row, int n)
{
    double mean = 0.0, variance = 0.0;
    for (int k = 0; k < n; k++)
        mean += row[k] / n;
    for (int k = 0; k < n; k++)
        variance += (row[k] - mean) * (row[k] - mean) / n;
    for (int k = 0; k < n; k++)
        row[k] = variance > 1e-9 ? (row[k] - mean) / sqrt(variance) : 0.0;
}

double saga_change_at(const saga_capture *c, int v, int k, size_t pixels)
{
    const size_t size = saga_view_frame_nbytes(&c->views[v]);
    const uint8_t *const a = saga_capture_frame(c, v, k);
    const uint8_t *const b = saga_capture_frame(c, v, k + 1);
    double sum = 0.0;
    /* Samples are R, G, B; only green is used. */
    for (size_t i = 1; i < size; i += 3 * pixels)
        sum += abs(a[i] - b[i]);
    return sum;
}

/* Fills a view's row. A fiftieth of the mean is added to each change, so that
 * the logarithm of moments without motion does not dominate. */
static void fill_row(double *row, const saga_capture *c, int v)
{
    const int n = c->n_frames - 1;
    double mean = 0.0;
    for (int k = 0; k < n; k++) {
        row[k] = saga_change_at(c, v, k, 5);
        mean += row[k] / n;
    }
    /* The row has logarithms of the changes, relative to their mean. */
    for (int k = 0; k < n; k++)
        row[k] = mean > 0.0 ? log(row[k] / mean + 0.02) : 0.0;
    /* The row becomes the differences of consecutive logarithms, one fewer. */
    for (int k = 0; k + 1 < n; k++)
        row[k] = row[k + 1] - row[k];
    normalise(row, n - 1);
}

/* ----------------------------------------------------------------- matching */

/* Returns the correlation of a row, moved back by `late`, with the others,
 * without the steps from `out` to `end` - 1. */
static double agreement(const matcher *m, const double *row, int late, int out,
                        int end)
{
    double a = 0.0, b = 0.0, aa = 0.0, bb = 0.0, ab = 0.0;
    int n = 0;
    for (int k = late < 0 ? -late : 0; k < m->n && k + late < m->n; k++) {
        const double x = row[k + late], y = m->others[k];
        if (k >= out && k < end)
            continue;
        a += x;
        b += y;
        aa += x * x;
        bb += y * y;
        ab += x * y;
        n++;
    }
    /* Pearson's correlation over the overlapping steps, with the means of just
     * these steps. */
    const double va = aa - a * a / fmax(n, 1), vb = bb - b * b / fmax(n, 1);
    return va > 1e-9 && vb > 1e-9 ? (ab - a * b / n) / sqrt(va * vb) : 0.0;
}

/* Returns the shift with the best agreement, refined by the parabola through it
 * and its neighbours. r (N_SHIFTS) receives the agreements, unless it is
 * NULL. */
static double best_shift(const matcher *m, const double *row, int out, int end,
                         double *r)
{
    double mine[N_SHIFTS];
    int best = 0;
    r = r ? r : mine;
    for (int i = 0; i <= 2 * m->most; i++) {
        r[i] = agreement(m, row, i - m->most, out, end);
        best = r[i] > r[best] ? i : best;
    }
    /* The parabola needs both neighbours, which a shift at an end of the range
     * lacks. */
    if (best == 0 || best == 2 * m->most)
        return best - m->most;
    /* The parabola through l, c, r at -1, 0, 1 has its maximum at (l - r) / (2
     * (l - 2 c + r)). */
    const double bend = r[best - 1] - 2.0 * r[best] + r[best + 1];
    return best - m->most +
           (bend < 0.0 ? 0.5 * (r[best - 1] - r[best + 1]) / bend : 0.0);
}

/* Sets the sum that a view is compared with, from the other views without group
 * g of n_groups; g < 0 leaves none out. */
static void set_others(const matcher *m, int view, int g, int n_groups)
{
    const double *const row = m->rows + (size_t)view * (size_t)m->n;
    for (int k = 0; k < m->n; k++)
        m->others[k] = m->sum[k] - row[k];
    for (int v = 0, i = 0; g >= 0 && v < m->n_views; v++) {
        const double *const other = m->rows + (size_t)v * (size_t)m->n;
        /* i counts the other views, so that the sizes of groups differ by at
         * most one view. */
        if (v == view || i++ % n_groups != g)
            continue;
        for (int k = 0; k < m->n; k++)
            m->others[k] -= other[k];
    }
}

double saga_jackknife(const double *x, int n)
{
    double mean = 0.0, sum = 0.0;
    for (int i = 0; i < n; i++)
        mean += x[i] / n;
    for (int i = 0; i < n; i++)
        sum += (x[i] - mean) * (x[i] - mean);
    return sum * (n - 1) / n;
}

static double standard_error(const matcher *m, int view)
{
    const double *const row = m->rows + (size_t)view * (size_t)m->n;
    const int n = m->n_views - 1 < GROUPS ? m->n_views - 1 : GROUPS;
    double x[GROUPS], variance;
    /* First an eighth of the steps at a time is left out of the correlation. */
    set_others(m, view, -1, 1);
    for (int g = 0; g < GROUPS; g++)
        x[g] = best_shift(m, row, g * m->n / GROUPS, (g + 1) * m->n / GROUPS,
                          NULL);
    variance = saga_jackknife(x, GROUPS);
    /* Then groups of views are left out of the sum. The two errors are taken as
     * independent, so that their variances add up. */
    for (int g = 0; g < n; g++) {
        set_others(m, view, g, n);
        x[g] = best_shift(m, row, 0, 0, NULL);
    }
    return sqrt(variance + saga_jackknife(x, n));
}

/* Tells whether the best agreement is higher than chance explains and has no
 * rival. */
static bool stands_out(const matcher *m, const double *r)
{
    double second = -1.0;
    int best = 0;
    for (int i = 0; i <= 2 * m->most; i++)
        best = r[i] > r[best] ? i : best;
    for (int i = 0; i <= 2 * m->most; i++)
        if (abs(i - best) > 1)
            second = fmax(second, r[i]);
    /* The number of overlapping steps is smaller by the shift. */
    const double n = m->n - abs(best - m->most);
    /* At an end of the range the true maximum may lie outside. */
    return best > 0 && best < 2 * m->most &&
           r[best] * sqrt(n) >= SURE_AGREEMENT &&
           (r[best] - second) * sqrt(n / 2.0) >= SURE_GAP;
}

static void find_one(saga_lateness *late, const matcher *m, int view)
{
    double r[N_SHIFTS];
    set_others(m, view, -1, 1);
    const double shift = best_shift(m, m->rows + (size_t)view * (size_t)m->n, 0,
                                    0, r);
    if (!stands_out(m, r))
        return;
    const double tolerance = LEAST_TOLERANCE +
                             STANDARD_ERRORS * standard_error(m, view);
    /* With a larger tolerance the view keeps NaN, because a wrong frame is
     * worse than no result. */
    if (tolerance <= MOST_TOLERANCE)
        *late = (saga_lateness){ .frames = shift, .tolerance = tolerance };
}

bool saga_lateness_find(saga_lateness *late, const saga_capture *capture,
                        saga_error *error)
{
    const saga_capture *const c = capture;
    const int n = c->n_frames - 2; /* the number of steps between logarithms of
                                    * changes */
    for (int v = 0; v < c->n_views; v++)
        late[v] = (saga_lateness){ .frames = NAN, .tolerance = NAN };
    if (c->n_frames < FEW_FRAMES || c->n_views < FEW_VIEWS || c->moves)
        return true;
    /* While a row is made it has one number more. */
    double *const rows = saga_calloc((size_t)(c->n_views + 2) * (size_t)n + 1,
                                     sizeof *rows, "the motion", error);
    if (!rows)
        return false;
    /* The shift is at most a third of the steps, so that two thirds still
     * overlap. */
    const matcher m = { .rows = rows,
                        .sum = rows + (size_t)c->n_views * (size_t)n,
                        .others = rows + (size_t)(c->n_views + 1) * (size_t)n,
                        .n_views = c->n_views,
                        .n = n,
                        .most = n / 3 < MOST_LATE ? n / 3 : MOST_LATE };
    for (int v = 0; v < c->n_views; v++)
        fill_row(rows + (size_t)v * (size_t)n, c, v);
    /* The sum is cleared after the rows are made, because the last row's extra
     * number lies in it. */
    memset(m.sum, 0, 2 * (size_t)n * sizeof *m.sum);
    for (int v = 0; v < c->n_views; v++)
        for (int k = 0; k < n; k++)
            m.sum[k] += rows[(size_t)v * (size_t)n + (size_t)k];
    for (int v = 0; v < c->n_views; v++)
        find_one(&late[v], &m, v);
    free(rows);
    return true;
}
