/* SPDX-License-Identifier: MIT */
#include "between.h"

#include "alloc.h"
#include "camera.h"
#include "flat.h"
#include "miniature.h"
#include "order.h"
#include "pictures.h"
#include "vec3.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The models, and the iterations of one: at least LEAST_ITERATIONS, and enough
 * to see each picture N_VISITS times. */
enum { N_FOLDS = 3, N_PRIMITIVES = 400, LEAST_ITERATIONS = 300, N_VISITS = 10 };

/* No model lacks more than this part of the cameras, nor more than this
 * number of them: these suffice for a mean. */
#define PART_LEFT_OUT 0.25
enum { MOST_LEFT_OUT = 16 };

/* A camera stands between two others if these are within this distance, in
 * spacings, and at least about 135 degrees apart as seen from it. Cameras that
 * are left out together are at least this far from each other, so that none
 * lacks a neighbour that it has in the film. */
#define NEAR 2.0
#define MOST_COSINE -0.7
#define LEAST_APART 1.5

/* The part of the excess that films have: they see more of the scene than one
 * small moment of it. Fitted (docs/lab/volume.md). */
#define EXCESS_PART 0.75

enum { NEVER = -1 };

static const char what[] = "the views between cameras";

typedef struct {
    saga_miniature small;
    int n;           /* number of its views */
    double *centre;  /* (n, 3) places of cameras, world units */
    double spacing;  /* median distance between nearest neighbours */
    bool *inner;     /* (n) the camera stands between others */
    int *fold;       /* (n) the model that lacks the camera, or NEVER */
    double *with;    /* (n) sum of squared errors in models that saw it */
    int *n_with;     /* (n) their number */
    double *without; /* (n) squared error in the model that lacks it */
} folds;

/* --- Cameras ------------------------------------------------------------- */

static double distance(const folds *f, int v, int w)
{
    return distance3(f->centre + 3 * w, f->centre + 3 * v);
}

static bool find_spacing(folds *f, saga_error *error)
{
    double *const nearest = saga_alloc((size_t)f->n, sizeof *nearest, what,
                                       error);

    for (int v = 0; nearest && v < f->n; v++) {
        nearest[v] = INFINITY;
        for (int w = 0; w < f->n; w++)
            if (w != v)
                nearest[v] = fmin(nearest[v], distance(f, v, w));
    }
    if (nearest)
        f->spacing = saga_median(nearest, (size_t)f->n);
    free(nearest);
    return nearest != NULL;
}

/* Sets `to` to the unit vector from camera v to w, in the plane of v's picture,
 * or about to zero if w is in front of v or behind it. On a ring, neighbours
 * are then in opposite directions. */
static void look_aside(double to[3], const folds *f, int v, int w)
{
    const double *const axis = f->small.capture.views[v].rotation + 6;
    double along = 0;

    for (int k = 0; k < 3; k++) {
        to[k] = f->centre[3 * w + k] - f->centre[3 * v + k];
        along += to[k] * axis[k];
    }
    for (int k = 0; k < 3; k++)
        to[k] -= along * axis[k];
    (void)normalise3(to);
}

static bool is_between(const folds *f, int v)
{
    for (int a = 0; a < f->n; a++) {
        double to_a[3], to_b[3];

        if (a == v || distance(f, v, a) > NEAR * f->spacing)
            continue;
        look_aside(to_a, f, v, a);
        for (int b = 0; b < a; b++) {
            if (b == v || distance(f, v, b) > NEAR * f->spacing)
                continue;
            look_aside(to_b, f, v, b);
            if (dot3(to_a, to_b) < MOST_COSINE)
                return true;
        }
    }
    return false;
}

/* Returns how far a camera is from those of a fold or, if `any`, of all
 * folds. */
static double apart(const folds *f, int v, int fold, bool any)
{
    double least = INFINITY;

    for (int w = 0; w < f->n; w++)
        if (any ? f->fold[w] != NEVER : f->fold[w] == fold)
            least = fmin(least, distance(f, v, w));
    return least;
}

/* Returns the camera that is next to be left out by a fold, the farthest from
 * those that are, or NEVER. */
static int next_of(const folds *f, int fold, bool first)
{
    double most = first ? 0 : LEAST_APART * f->spacing;
    int best = NEVER;

    for (int v = 0; v < f->n; v++) {
        const double d = f->inner[v] && f->fold[v] == NEVER
                             ? apart(f, v, fold, first)
                             : 0;

        if (d > most) {
            most = d;
            best = v;
        }
    }
    return best;
}

static void choose(folds *f)
{
    const int most = (int)fmin(fmax(PART_LEFT_OUT * f->n, 1), MOST_LEFT_OUT);

    for (int v = 0; v < f->n; v++) {
        f->inner[v] = is_between(f, v);
        f->fold[v] = NEVER;
    }
    for (int fold = 0; fold < N_FOLDS; fold++)
        for (int i = 0; i < most; i++) {
            const int v = next_of(f, fold, i == 0);

            if (v != NEVER)
                f->fold[v] = fold;
        }
}

/* --- Models -------------------------------------------------------------- */

static int n_iterations(int n_views)
{
    return n_views * N_VISITS > LEAST_ITERATIONS ? n_views * N_VISITS
                                                 : LEAST_ITERATIONS;
}

double saga_between_work(const saga_capture *c)
{
    int n;
    const double pixels = saga_miniature_pixels(c, &n);

    return N_FOLDS * n_iterations(n) * pixels / fmax(n, 1);
}

/* Returns the mean squared error of an image (3, H, W) over the pixels that
 * count when a film is measured: of a subject, those where it is. exposure has
 * three factors on the truth. Returns NaN if no pixel counts. */
static double error_of(const real *image, const saga_source_view *v,
                       const double *exposure)
{
    const size_t n = (size_t)v->width * (size_t)v->height;
    size_t n_counting = 0;
    double sum = 0;

    for (size_t i = 0; i < n; i++) {
        if (v->mask && !v->mask[i])
            continue;
        n_counting++;
        for (size_t k = 0; k < 3; k++) {
            const double e = (double)image[k * n + i] -
                             exposure[k] * v->rgb[3 * i + k] / 255;

            sum += e * e;
        }
    }
    return n_counting ? sum / (3.0 * (double)n_counting) : (double)NAN;
}

static bool compare(folds *f, saga_flat *flat, const saga_pictures *p, int fold,
                    saga_error *error)
{
    real *const image = saga_alloc(3 * saga_pictures_largest(p), sizeof *image,
                                   what, error);
    bool ok = image != NULL;

    for (int v = 0; ok && v < f->n; v++) {
        double mse;

        ok = saga_flat_render(flat, image, &mse, (saga_sample){ .view = v },
                              error);
        if (!ok)
            break;
        /* A film is measured where its pixels count, a model of a subject on
         * whole pictures. */
        mse = error_of(image, &f->small.capture.views[v], p->exposure + 3 * v);
        if (f->fold[v] == fold)
            f->without[v] = mse;
        else {
            f->with[v] += mse;
            f->n_with[v]++;
        }
    }
    free(image);
    return ok;
}

static bool train(folds *f, saga_pictures *p, int fold, uint64_t seed,
                  saga_error *error)
{
    saga_flat_options o = saga_flat_defaults();
    saga_flat *flat;
    double mse;
    bool ok;

    o.n_primitives = N_PRIMITIVES;
    o.n_iterations = n_iterations(f->n);
    o.seed = seed;
    o.temporal = 0;
    flat = saga_flat_new(p, &o, error);
    ok = flat != NULL;
    for (int i = 0; ok && i < o.n_iterations; i++)
        ok = saga_flat_iterate(flat, &mse, error);
    ok = ok && compare(f, flat, p, fold, error);
    saga_flat_free(flat);
    return ok;
}

/* Trains a model without the cameras of a fold, which may be none. */
static bool run_fold(folds *f, const double *exposure, int fold, uint64_t seed,
                     saga_error *error)
{
    saga_pictures p;
    bool ok;

    for (int v = 0; v < f->n; v++)
        f->small.capture.views[v].held_out = f->fold[v] == fold;
    if (!saga_pictures_init(&p, &f->small.capture, error))
        return false;
    for (int v = 0; v < f->n; v++)
        memcpy(p.exposure + 3 * (size_t)v,
               exposure + 3 * (size_t)f->small.view[v], 3 * sizeof *exposure);
    ok = train(f, &p, fold, seed, error);
    saga_pictures_free(&p);
    return ok;
}

/* --- The prediction ------------------------------------------------------ */

static bool begin(folds *f, const saga_capture *c, saga_error *error)
{
    size_t n;

    *f = (folds){ .n = 0 };
    if (!saga_miniature_make(&f->small, c, error))
        return false;
    f->n = f->small.capture.n_views;
    n = (size_t)f->n;
    f->centre = saga_alloc(3 * n, sizeof *f->centre, what, error);
    f->inner = saga_calloc(n, sizeof *f->inner, what, error);
    f->fold = saga_alloc(n, sizeof *f->fold, what, error);
    f->with = saga_calloc(n, sizeof *f->with, what, error);
    f->n_with = saga_calloc(n, sizeof *f->n_with, what, error);
    f->without = saga_calloc(n, sizeof *f->without, what, error);
    if (!f->centre || !f->inner || !f->fold || !f->with || !f->n_with ||
        !f->without)
        return false;
    for (int v = 0; v < f->n; v++)
        saga_source_view_centre(f->centre + 3 * v, &f->small.capture.views[v]);
    return find_spacing(f, error);
}

static void end(folds *f)
{
    saga_miniature_free(&f->small);
    free(f->centre);
    free(f->inner);
    free(f->fold);
    free(f->with);
    free(f->n_with);
    free(f->without);
}

/* Returns the mean PSNR of the cameras that were left out, with their excesses.
 * Those of which no pixel counts say nothing. */
static saga_between conclude(const folds *f, double at_cameras)
{
    const double there = pow(10, -at_cameras / 10);
    saga_between b = { .psnr = 0 };

    for (int v = 0; v < f->n; v++) {
        double excess;

        if (f->fold[v] == NEVER || isnan(f->without[v]))
            continue;
        excess = f->without[v] - f->with[v] / f->n_with[v];
        b.psnr -= 10 * log10(there + EXCESS_PART * fmax(excess, 0));
        b.n_views++;
    }
    b.psnr = b.n_views ? b.psnr / b.n_views : (double)NAN;
    return b;
}

bool saga_between_predict(saga_between *out, const saga_capture *capture,
                          const double *exposure, double at_cameras,
                          uint64_t seed, saga_error *error)
{
    folds f;
    bool ok = begin(&f, capture, error), any = false;

    if (ok)
        choose(&f);
    for (int v = 0; ok && v < f.n; v++)
        any = any || f.fold[v] != NEVER;
    for (int fold = 0; ok && any && fold < N_FOLDS; fold++)
        ok = run_fold(&f, exposure, fold, seed, error);
    if (ok)
        *out = conclude(&f, at_cameras);
    end(&f);
    return ok;
}
