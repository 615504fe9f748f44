/* SPDX-License-Identifier: MIT
 *
 * Measures how late a camera is by corners that move. In the frames with most
 * change, corners of one camera are matched with those of another at the same
 * moment and up to SAGA_MATCH_LATE frames before and after. A match counts 1 -
 * (e / within)^2, where e is its distance from the epipolar line. The shift
 * with the largest count is the lateness, if that count is clearly larger than
 * at other shifts, if the shift is stable when an eighth of the data is left
 * out, and if more than one other camera counts there: of two cameras that
 * match only each other nobody knows which one is late.
 */
#include "late_matches.h"

#include "alloc.h"
#include "epipolar.h"
#include "pairs.h"

#include <math.h>
#include <stdlib.h>

enum {
    MOST = SAGA_MATCH_LATE,
    N_SHIFTS = 2 * MOST + 1,
    MOMENTS = 6,
    STRETCH = 2 * MOST + MOMENTS,
    GROUPS = 8,
    PATCH = 2, /* pixels on each side of a corner */
    STEP = 2   /* frames over which the patch must change */
};

#define MOVES 8.0 /* least mean change of a patch, in levels */
/* Least cosine of two descriptors, as for points. */
#define ALIKE 0.75
#define FEW 8.0 /* least sum of counts for a result */
/* Least part of the count that remains without the camera that adds most to
 * it. */
#define OTHERS 0.25
#define SURE 3.0 /* standard deviations; a count of n has sqrt(n) */
/* The standard errors are those of eight groups, as in lateness.c. The parabola
 * through three counts is exact to a quarter of a frame, and a late neighbour
 * shifts the result by as much. */
#define STANDARD_ERRORS 2.4
#define LEAST_TOLERANCE 0.3
#define MOST_TOLERANCE 0.5

typedef struct counts {
    double at[GROUPS][N_SHIFTS];
} counts;

typedef struct finder {
    const saga_capture *c;
    int first;                   /* first frame of the examined interval */
    saga_pairs at[STRETCH];      /* corners of all views at these frames; the
                                  * first one has the list of pairs for all */
    counts *counts;              /* (n_views) */
    double (*of_pair)[N_SHIFTS]; /* (pairs) counts of each pair, as those of its
                                  * view b */
} finder;

/* ------------------------------------------------------------------ corners */

/* Returns the first frame of the interval of STRETCH frames with most
 * change. */
static int find_stretch(const saga_capture *c)
{
    /* The changes of the last STRETCH steps are kept in a ring, together with
     * their sum. All are integers, so that adding and subtracting is exact. */
    double change[STRETCH] = { 0.0 }, sum = 0.0, most = -1.0;
    int first = 0;
    for (int k = 0; k + 1 < c->n_frames; k++) {
        double *const at = &change[k % STRETCH];
        sum -= *at;
        *at = 0.0;
        for (int v = 0; v < c->n_views; v++)
            *at += saga_change_at(c, v, k, 33);
        sum += *at;
        if (k >= STRETCH - 1 && sum > most) {
            most = sum;
            first = k - (STRETCH - 1);
        }
    }
    return first;
}

/* Tells whether the patch around a corner changes within STEP frames. */
static bool moves(const saga_capture *c, int v, int frame,
                  const saga_feature *f)
{
    const saga_source_view *const s = &c->views[v];
    const int other = frame + STEP < c->n_frames ? frame + STEP : frame - STEP;
    const uint8_t *const a = saga_capture_frame(c, v, frame);
    const uint8_t *const b = saga_capture_frame(c, v, other);
    const int x = (int)f->x, y = (int)f->y;
    double sum = 0.0;
    if (x < PATCH || y < PATCH || x >= s->width - PATCH ||
        y >= s->height - PATCH)
        return false;
    for (int j = y - PATCH; j <= y + PATCH; j++)
        for (int i = 3 * (x - PATCH); i < 3 * (x + PATCH + 1); i++)
            sum += abs(a[(size_t)j * saga_view_row_nbytes(s) + (size_t)i] -
                       b[(size_t)j * saga_view_row_nbytes(s) + (size_t)i]);
    return sum > MOVES * 3 * (2 * PATCH + 1) * (2 * PATCH + 1);
}

/* Finds the moving corners in all frames of the interval. */
static bool find_corners(finder *f, saga_error *error)
{
    for (int k = 0; k < STRETCH; k++) {
        if (!saga_pairs_look(&f->at[k], f->c, f->first + k, error))
            return false;
        for (int v = 0; v < f->c->n_views; v++) {
            saga_features *const all = &f->at[k].features[v];
            size_t kept = 0;
            for (size_t i = 0; i < all->n; i++)
                if (moves(f->c, v, f->first + k, &all->list[i]))
                    all->list[kept++] = all->list[i];
            all->n = kept;
        }
    }
    return saga_pairs_list(&f->at[0], error);
}

/* ------------------------------------------------------------------- counts */

typedef struct lines {
    const saga_pinhole *a, *b;
    saga_epipolar between;
    double within;
} lines;

static double off_line(const lines *l, const double a[2], const double b[2])
{
    const saga_match m = { .a = { a[0], a[1] }, .b = { b[0], b[1] } };
    bool front;
    const double off = saga_epipolar_off(l->a, l->b, &l->between, &m, l->within,
                                         &front);
    return front ? off / l->within : 2.0;
}

static bool on_line(const void *user, const saga_feature *a,
                    const saga_feature *b)
{
    const double x[2] = { a->x, a->y }, y[2] = { b->x, b->y };
    return off_line(user, x, y) <= 1.0;
}

/* Returns the weighted number of matches between view a at frame k of the
 * interval and view b `late` frames later. */
static double count(const finder *f, const saga_pair *p, int k, int late)
{
    const saga_pinhole a = saga_pinhole_of(&f->c->views[p->a]);
    const saga_pinhole b = saga_pinhole_of(&f->c->views[p->b]);
    const lines l = { &a, &b, saga_epipolar_between(&a, &b), f->at[k].within };
    saga_match m[SAGA_FEATURES_MOST];
    const size_t n = saga_matches_find(
        m, &f->at[k].features[p->a], &f->at[k + late].features[p->b],
        &(saga_match_rule){ on_line, &l, ALIKE });
    double sum = 0.0;
    for (size_t i = 0; i < n; i++) {
        const double e = off_line(&l, m[i].a, m[i].b);
        sum += 1.0 - e * e;
    }
    return sum;
}

/* Adds the counts of a pair to both of its views; if one is late, the other is
 * early. */
static void count_pair(finder *f, size_t i)
{
    const saga_pair *const p = &f->at[0].list[i];
    double found[MOMENTS][N_SHIFTS];
#pragma omp parallel for collapse(2) schedule(dynamic)
    for (int k = 0; k < MOMENTS; k++)
        for (int d = 0; d < N_SHIFTS; d++)
            found[k][d] = count(f, p, MOST + k, d - MOST);
    for (int k = 0; k < MOMENTS; k++)
        for (int d = 0; d < N_SHIFTS; d++) {
            const size_t g = (MOMENTS * i + (size_t)k) % GROUPS;
            f->of_pair[i][d] += found[k][d];
            f->counts[p->b].at[g][d] += found[k][d];
            f->counts[p->a].at[g][N_SHIFTS - 1 - d] += found[k][d];
        }
}

/* ------------------------------------------------------------------ verdict */

/* Sums all groups except one, and returns the shift with the largest sum. */
static int sum_groups(double sum[N_SHIFTS], const counts *c, int without)
{
    int best = 0;
    for (int d = 0; d < N_SHIFTS; d++) {
        sum[d] = 0.0;
        for (int g = 0; g < GROUPS; g++)
            sum[d] += g == without ? 0.0 : c->at[g][d];
        best = sum[d] > sum[best] ? d : best;
    }
    return best;
}

/* Returns the maximum, between shifts, of the parabola through the best shift
 * and its neighbours. */
static double peak(const double sum[N_SHIFTS], int best)
{
    if (best == 0 || best == N_SHIFTS - 1)
        return best - MOST;
    const double l = sum[best - 1], c = sum[best], r = sum[best + 1];
    const double bend = l - 2.0 * c + r;
    return best - MOST + (bend < 0.0 ? 0.5 * (l - r) / bend : 0.0);
}

/* Returns the largest count that one other camera adds to that of view v at a
 * shift. */
static double most_of_one(const finder *f, int v, int shift)
{
    double most = 0.0;
    for (size_t i = 0; i < f->at[0].n; i++) {
        const saga_pair *const p = &f->at[0].list[i];
        if (p->b == v)
            most = fmax(most, f->of_pair[i][shift]);
        else if (p->a == v)
            most = fmax(most, f->of_pair[i][N_SHIFTS - 1 - shift]);
    }
    return most;
}

static void judge(saga_lateness *late, const finder *f, int v)
{
    const counts *const c = &f->counts[v];
    double sum[N_SHIFTS], part[N_SHIFTS], x[GROUPS], second = 0.0;
    const int best = sum_groups(sum, c, -1);
    for (int d = 0; d < N_SHIFTS; d++)
        if (abs(d - best) > 1)
            second = fmax(second, sum[d]);
    /* At an end of the range the true maximum may lie outside. */
    if (best == 0 || best == N_SHIFTS - 1 || sum[best] < FEW ||
        sum[best] - second < SURE * sqrt(sum[best] + second) ||
        sum[best] - most_of_one(f, v, best) < OTHERS * sum[best])
        return;
    for (int g = 0; g < GROUPS; g++)
        x[g] = peak(part, sum_groups(part, c, g));
    const double tolerance = LEAST_TOLERANCE +
                             STANDARD_ERRORS * sqrt(saga_jackknife(x, GROUPS));
    if (tolerance <= MOST_TOLERANCE)
        *late = (saga_lateness){ .frames = peak(sum, best),
                                 .tolerance = tolerance };
}

bool saga_late_matches_find(saga_lateness *late, const saga_capture *capture,
                            saga_error *error)
{
    const size_t n_views = (size_t)capture->n_views;
    finder f = { .c = capture };
    for (size_t v = 0; v < n_views; v++)
        late[v] = (saga_lateness){ .frames = NAN, .tolerance = NAN };
    if (capture->n_frames < STRETCH || n_views < 3 || capture->moves)
        return true;
    /* Corners are found once, then matched for each pair and each shift. */
    f.first = find_stretch(capture);
    f.counts = saga_calloc(n_views, sizeof *f.counts, "the motion", error);
    bool ok = f.counts && find_corners(&f, error);
    if (ok) {
        f.of_pair = saga_calloc(f.at[0].n, sizeof *f.of_pair, "the motion",
                                error);
        ok = f.of_pair != NULL;
    }
    for (size_t i = 0; ok && i < f.at[0].n; i++)
        count_pair(&f, i);
    for (size_t v = 0; ok && v < n_views; v++)
        judge(&late[v], &f, (int)v);
    for (int k = 0; k < STRETCH; k++)
        if (f.at[k].capture)
            saga_pairs_free(&f.at[k]);
    free(f.counts);
    free(f.of_pair);
    return ok;
}
