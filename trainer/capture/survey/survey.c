/* SPDX-License-Identifier: MIT */
#include "survey.h"

#include "alloc.h"
#include "exposure.h"
#include "late_matches.h"
#include "order.h"
#include "pose.h"
#include "survey_judge.h"
#include "survey_pictures.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    GRID = 12, /* rays per side for each camera */
    MOST_PLACES = 20000,
    MOST_COMPARED = 200000000,
    FEW_COLOURS = 30,
    CELLS = 24 /* cells per side of a picture; 2,500 places take
                * about four of each cell */
};
/* A place this much farther than the first one in its cell may be hidden. */
#define BEHIND 1.1

typedef struct places {
    double (*at)[3]; /* (n) */
    size_t n;
    double middle[3];
} places;

/* ------------------------------------------------------------------- places */

/* Finds the point with the least sum of squared distances from the axes of all
 * cameras, by Cramer's rule. Returns false if the axes are parallel. */
static bool axes_meet(const saga_capture *c, double x[3])
{
    double m[3][3] = { { 0 } }, b[3] = { 0 };
    for (int v = 0; v < c->n_views; v++) {
        const double *const axis = c->views[v].rotation + 6;
        double centre[3];
        saga_pose_centre(c->views[v].rotation, c->views[v].translation, centre);
        /* The projection I - a a^T removes the part along the axis; x solves
         * sum (I - a a^T) x = sum (I - a a^T) centre. */
        for (int i = 0; i < 3; i++)
            for (int j = 0; j < 3; j++) {
                const double part = (i == j) - axis[i] * axis[j];
                m[i][j] += part;
                b[i] += part * centre[j];
            }
    }
    const double det = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                       m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                       m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
    /* det is 0 for parallel axes, and at most (2 n / 3)^3 for axes in all
     * directions. */
    if (!(fabs(det) > 1e-4 * pow(c->n_views, 3)))
        return false;
    for (int k = 0; k < 3; k++) {
        /* Cramer's rule: the right side replaces column k. */
        double n[3][3];
        memcpy(n, m, sizeof n);
        for (int i = 0; i < 3; i++)
            n[i][k] = b[i];
        x[k] = (n[0][0] * (n[1][1] * n[2][2] - n[1][2] * n[2][1]) -
                n[0][1] * (n[1][0] * n[2][2] - n[1][2] * n[2][0]) +
                n[0][2] * (n[1][0] * n[2][1] - n[1][1] * n[2][0])) /
               det;
    }
    return true;
}

/* Makes places for a capture without points: on rays of each camera, at the
 * depth where the axes meet, or at four times the size of the rig. */
static void lift_grid(places *p, const saga_capture *c)
{
    double meeting[3], size = 0.0, first[3], centre[3];
    const bool meet = axes_meet(c, meeting);
    saga_pose_centre(c->views[0].rotation, c->views[0].translation, first);
    for (int v = 0; v < c->n_views; v++) {
        saga_pose_centre(c->views[v].rotation, c->views[v].translation, centre);
        size = fmax(size,
                    hypot(hypot(centre[0] - first[0], centre[1] - first[1]),
                          centre[2] - first[2]));
    }
    for (int v = 0; v < c->n_views; v++) {
        const saga_source_view *const s = &c->views[v];
        const double far = 4.0 * (size > 0.0 ? size : 1.0);
        double cam[3] = { 0.0, 0.0, far };
        /* z is the depth at which the axes meet, if that is in front of this
         * camera. */
        if (meet)
            saga_view_transform(s, meeting, cam);
        const double z = cam[2] > 0.0 ? cam[2] : far;
        for (int i = 0; i < GRID * GRID; i++) {
            const double uv[2] = { s->width * (i % GRID + 0.5) / GRID,
                                   s->height * (i / GRID + 0.5) / GRID };
            saga_view_lift(s, uv, z, p->at[p->n++]);
        }
    }
}

static bool find_places(places *p, const saga_capture *c, saga_error *error)
{
    const bool points = c->n_points >= SAGA_FEW_PLACES;
    const size_t n = points ? c->n_points : (size_t)c->n_views * GRID * GRID;
    /* Every pair of views is compared at every place, which limits their
     * number. */
    const size_t most =
        MOST_COMPARED / (size_t)c->n_views / (size_t)c->n_views + 200;
    const size_t step = n / (most < MOST_PLACES ? most : MOST_PLACES) + 1;
    p->at = saga_alloc(n, sizeof *p->at, "the places", error);
    if (!p->at)
        return false;
    if (!points)
        lift_grid(p, c);
    for (size_t i = 0; points && i < n; i++)
        memcpy(p->at[i], c->points[i].position, sizeof *p->at);
    /* Every step-th place is kept. */
    p->n = 0;
    for (size_t i = 0; i < n; i += step)
        memmove(p->at[p->n++], p->at[i], sizeof *p->at);
    double *const x = saga_alloc(p->n, sizeof *x, "the places", error);
    for (int k = 0; x && k < 3; k++) {
        for (size_t i = 0; i < p->n; i++)
            x[i] = p->at[i][k];
        p->middle[k] = saga_median(x, p->n);
    }
    free(x);
    return x != NULL;
}

/* Returns the index of the pixel that shows a place in a view, or -1 if the
 * view does not see it. */
static long pixel_of(const saga_source_view *s, const double place[3])
{
    double uv[2], depth;
    if (!saga_view_project(s, place, uv, &depth) || uv[0] < 0.0 ||
        uv[1] < 0.0 || uv[0] >= s->width || uv[1] >= s->height)
        return -1;
    return (long)uv[1] * s->width + (long)uv[0];
}

/* Returns the cell of all views' pictures in which view v sees a place, or -1,
 * and sets the depth of the place. */
static long cell_of(const saga_source_view *s, int v, const double place[3],
                    double *depth)
{
    const long pixel = pixel_of(s, place);
    double cam[3];
    if (pixel < 0)
        return -1;
    saga_view_transform(s, place, cam);
    *depth = cam[2];
    return ((long)v * CELLS + pixel / s->width * CELLS / s->height) * CELLS +
           pixel % s->width * CELLS / s->width;
}

/* ----------------------------------------------------------------- geometry */

/* Sets d to the direction of a camera from the middle, and returns its
 * distance. */
static double direction_from(const double middle[3], const saga_source_view *s,
                             double d[3])
{
    saga_pose_centre(s->rotation, s->translation, d);
    for (int k = 0; k < 3; k++)
        d[k] -= middle[k];
    const double n = hypot(hypot(d[0], d[1]), d[2]);
    for (int k = 0; k < 3; k++)
        d[k] /= n > 0.0 ? n : 1.0;
    return n;
}

static void find_nearest(saga_survey *survey, const saga_capture *c,
                         const double middle[3])
{
    for (int v = 0; v < c->n_views; v++) {
        saga_survey_view *const one = &survey->views[v];
        double a[3], b[3];
        one->nearest = -1;
        one->angle = (double)NAN;
        const double own = direction_from(middle, &c->views[v], a);
        for (int w = 0; w < c->n_views; w++) {
            const double other = direction_from(middle, &c->views[w], b);
            const double cosine = dot3(a, b);
            /* Rounding may make the cosine larger than 1. */
            const double angle = acos(fmin(fmax(cosine, -1.0), 1.0)) *
                                 57.29577951308232;
            if (w == v || (one->nearest >= 0 && angle >= one->angle))
                continue;
            one->nearest = w;
            one->angle = angle;
            /* The law of cosines. */
            one->step = sqrt(fmax(own * own + other * other -
                                      2.0 * own * other * cosine,
                                  0.0)) /
                        fmax(fmin(own, other), 1e-300);
        }
    }
}

/* seen (n_views, n) tells whether a view sees a place. */
static void find_overlap(saga_survey *survey, const saga_capture *c,
                         const places *p, const bool *seen)
{
    for (int v = 0; v < c->n_views; v++) {
        const bool *const a = seen + p->n * (size_t)v;
        size_t n = 0, best = 0;
        for (size_t i = 0; i < p->n; i++)
            n += a[i];
        for (int w = 0; w < c->n_views; w++) {
            const bool *const b = seen + p->n * (size_t)w;
            size_t both = 0;
            for (size_t i = 0; w != v && i < p->n; i++)
                both += a[i] && b[i];
            best = both > best ? both : best;
        }
        survey->views[v].seen = p->n ? (double)n / (double)p->n : 0.0;
        survey->views[v].overlap = c->n_views < 2 ? (double)NAN
                                   : n            ? (double)best / (double)n
                                                  : 0.0;
    }
}

/* ------------------------------------------------------------------ colours */

/* The least depth of any place in each cell of each view's picture: what lies
 * clearly behind it may be hidden, as the far side of a thing is from cameras
 * that stand round it. */
static double *find_front(const saga_capture *c, const places *p,
                          saga_error *error)
{
    const size_t n = (size_t)c->n_views * CELLS * CELLS;
    double *const front = saga_alloc(n, sizeof *front, "the colours", error);
    for (size_t i = 0; front && i < n; i++)
        front[i] = (double)INFINITY;
    for (int v = 0; front && v < c->n_views; v++)
        for (size_t i = 0; i < p->n; i++) {
            double depth;
            const long cell = cell_of(&c->views[v], v, p->at[i], &depth);
            if (cell >= 0 && depth < front[cell])
                front[cell] = depth;
        }
    return front;
}

/* Sets rgb to the display colour that a view's first frame shows at a place.
 * Returns false if it does not show the place. */
static bool colour_at(const saga_capture *c, const double *front, int v,
                      const double place[3], double rgb[3])
{
    const uint8_t *const mask = saga_capture_mask(c, v, 0);
    double depth;
    const long cell = cell_of(&c->views[v], v, place, &depth);
    long pixel = cell < 0 || depth > BEHIND * front[cell]
                     ? -1
                     : pixel_of(&c->views[v], place);
    if (pixel >= 0 && mask && !mask[pixel])
        pixel = -1;
    for (int k = 0; pixel >= 0 && k < 3; k++)
        rgb[k] = saga_capture_frame(c, v, 0)[3 * pixel + k];
    return pixel >= 0;
}

/* Sets rgb to the median colour of a place over the views that see it, and
 * returns their number. */
static size_t common_colour(const saga_capture *c, const double *front,
                            const double place[3], double *scratch,
                            double rgb[3])
{
    const size_t most = (size_t)c->n_views;
    size_t n = 0;
    for (int v = 0; v < c->n_views; v++) {
        double one[3];
        if (!colour_at(c, front, v, place, one))
            continue;
        for (size_t k = 0; k < 3; k++)
            /* scratch is (3, n_views), because each channel has its own
             * median. */
            scratch[k * most + n] = one[k];
        n++;
    }
    for (size_t k = 0; k < 3; k++)
        rgb[k] = saga_median(scratch + k * most, n);
    return n;
}

/* The colours of places: of each the common one, (n, 3), NaN if fewer than
 * three views see the place; the fronts of the views; and scratch memory. */
typedef struct colours {
    double *common, *front, *x;
} colours;

/* Returns the median difference of a view's colours from the common ones, with
 * the view's values divided by `gain`; NaN if they are too few. */
static double differ(const saga_capture *c, int v, const places *p,
                     const colours *of, double gain, bool swapped)
{
    size_t n = 0;
    double rgb[3];
    for (size_t i = 0; i < p->n; i++) {
        if (isnan(of->common[3 * i]) ||
            !colour_at(c, of->front, v, p->at[i], rgb))
            continue;
        for (int k = 0; k < 3; k++)
            rgb[k] /= gain;
        of->x[n++] = saga_colour_apart(rgb, of->common + 3 * i, swapped);
    }
    return n >= FEW_COLOURS ? saga_median(of->x, n) : (double)NAN;
}

/* Compares a view's colours with the common ones. */
static void compare_view(saga_survey_view *one, const saga_capture *c, int v,
                         const places *p, const colours *of)
{
    size_t n = 0;
    double rgb[3];
    /* The exposure is the median of log2 of the light relative to the common
     * colours. */
    for (size_t i = 0; i < p->n; i++)
        if (!isnan(of->common[3 * i]) &&
            colour_at(c, of->front, v, p->at[i], rgb) &&
            saga_exposure_compare(of->x + n, rgb, of->common + 3 * i))
            n++;
    one->stops = n >= FEW_COLOURS ? saga_median(of->x, n) : (double)NAN;
    const double gain = isnan(one->stops) ? 1.0
                                          : saga_exposure_gain(one->stops);
    /* The colour is the difference that remains after the exposure is
     * corrected. */
    one->colour = differ(c, v, p, of, gain, false);
    one->swapped = differ(c, v, p, of, gain, true) / one->colour;
}

static bool compare_colours(saga_survey *survey, const saga_capture *c,
                            const places *p, saga_error *error)
{
    const colours of = { .common = saga_alloc(p->n, 3 * sizeof *of.common,
                                              "the colours", error),
                         .front = find_front(c, p, error),
                         .x = saga_alloc(p->n + 3 * (size_t)c->n_views,
                                         sizeof *of.x, "the colours", error) };
    const bool ok = of.common && of.front && of.x;
    /* The scratch memory is first for medians over views, then over places. */
    for (size_t i = 0; ok && i < p->n; i++)
        if (common_colour(c, of.front, p->at[i], of.x, of.common + 3 * i) < 3)
            of.common[3 * i] = (double)NAN;
    for (int v = 0; ok && v < c->n_views; v++)
        compare_view(&survey->views[v], c, v, p, &of);
    free(of.common);
    free(of.front);
    free(of.x);
    return ok;
}

/* Takes exposures and colours from matches where there are enough, because both
 * cameras certainly see a match. */
static void take_match_colours(saga_survey *s, int n_views)
{
    for (int v = 0; v < n_views; v++) {
        const saga_match_colour *const m = &s->calibration.colours[v];
        saga_survey_view *const one = &s->views[v];
        if (isnan(m->stops))
            continue;
        one->stops = m->stops;
        one->colour = m->colour;
        one->swapped = m->swapped;
    }
}

/* ----------------------------------------------------------------- together */

/* Finds how late each view is: from how much of its picture changes at each
 * frame and, unless the calibration was found wrong, from matches between
 * views. The more certain result is used. */
static bool take_late(saga_survey *s, const saga_capture *c, saga_error *error)
{
    const bool fits = !s->calibration.found && !s->calibration.bad;
    saga_lateness *const late = saga_alloc((size_t)c->n_views, sizeof *late,
                                           "the motion", error);
    bool ok = late && saga_lateness_find(late, c, error);
    for (int v = 0; ok && v < c->n_views; v++)
        s->views[v].late = late[v];
    ok = ok && (!fits || saga_late_matches_find(late, c, error));
    for (int v = 0; ok && fits && v < c->n_views; v++)
        if (isnan(s->views[v].late.frames) ||
            late[v].tolerance < s->views[v].late.tolerance)
            s->views[v].late = late[v];
    free(late);
    return ok;
}

static bool measure(saga_survey *s, const saga_capture *c, places *p,
                    saga_error *error)
{
    if (!find_places(p, c, error))
        return false;
    const size_t n = p->n, n_views = (size_t)c->n_views;
    bool *const seen = saga_alloc(n * n_views, sizeof *seen, "places seen",
                                  error);
    double *const angle = saga_alloc(n_views, sizeof *angle, "the angles",
                                     error);
    const bool ok = seen && angle;
    /* Each place is projected into each view once; overlaps are computed from
     * the result. */
    for (size_t v = 0; ok && v < n_views; v++)
        for (size_t i = 0; i < n; i++)
            seen[n * v + i] = pixel_of(&c->views[v], p->at[i]) >= 0;
    if (ok) {
        find_overlap(s, c, p, seen);
        find_nearest(s, c, p->middle);
        for (size_t v = 0; v < n_views; v++)
            angle[v] = s->views[v].angle;
        s->typical_angle = saga_median(angle, n_views);
    }
    free(seen);
    free(angle);
    return ok &&
           (c->n_points < SAGA_FEW_PLACES || compare_colours(s, c, p, error));
}

bool saga_survey_make(saga_survey *survey, const saga_capture *capture,
                      saga_error *error)
{
    places p = { .n = 0 };
    *survey = (saga_survey){ .views = NULL };
    survey->views = saga_calloc((size_t)capture->n_views, sizeof *survey->views,
                                "the views", error);
    saga_look *const looks = saga_alloc((size_t)capture->n_views, sizeof *looks,
                                        "the views", error);
    for (int v = 0; survey->views && v < capture->n_views; v++)
        survey->views[v].stops = survey->views[v].colour =
            survey->views[v].swapped = (double)NAN;
    /* Measurements come first and can fail. */
    const bool ok = survey->views && looks &&
                    saga_looks_find(looks, capture, error) &&
                    measure(survey, capture, &p, error) &&
                    saga_calibration_find(&survey->calibration, capture,
                                          error) &&
                    take_late(survey, capture, error);
    for (int v = 0; ok && v < capture->n_views; v++)
        survey->views[v].look = looks[v];
    free(looks);
    free(p.at);
    if (!ok)
        return false;
    take_match_colours(survey, capture->n_views);
    /* Judgements come last and only add notes. */
    if (!saga_survey_judge_pictures(survey, capture, error))
        return false;
    survey->wrong_nbytes = strlen(survey->notes);
    saga_survey_judge(survey, capture);
    return true;
}

void saga_survey_free(saga_survey *survey)
{
    free(survey->views);
    saga_calibration_free(&survey->calibration);
    survey->views = NULL;
}
