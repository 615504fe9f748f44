/* SPDX-License-Identifier: MIT
 *
 * Compares pixels at random, whose depth a plane sweep finds, with the same
 * place in other views, and solves for the exposures.
 */
#include "exposure_match.h"

#include "alloc.h"
#include "exposure.h"
#include "flat_state.h"
#include "plane_sweep.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    N_PIXELS = 2000,
    N_PASSES = 3 /* matches improve when exposures agree */
};

#define WORTH_IT 0.03 /* least difference of log exposures */
/* The first pass found at least 0.57 of what the last one did
 * (docs/lab/warm-up.md), so that less than half of WORTH_IT is not worth
 * another. */
#define WORTH_LOOKING (WORTH_IT / 2)
/* Largest part of all differences that may remain; if more does, the factors
 * come from wrong matches. */
#define LEFT_PART 0.8

typedef struct job {
    const saga_pictures *pictures;
    uint64_t seed;
    int pass;
    saga_exposure_pair *at; /* (N_PIXELS, SAGA_PLANE_NEAR) */
} job;

/* Sums each channel of a patch. Returns false if a pixel is nearly black or
 * white, and so may be clipped. */
static bool sum_of(double sum[3], const saga_patch *p)
{
    for (int k = 0; k < 3; k++) {
        sum[k] = 0;
        for (int y = 0; y < SAGA_PATCH_SIDE; y++)
            for (int x = 0; x < SAGA_PATCH_SIDE; x++) {
                const double a = (double)p->at[y][3 * x + k];

                if (!(a > 0.04 && a < 0.94))
                    return false;
                sum[k] += a;
            }
    }
    return true;
}

/* Compares a pixel with its place in the nearest views, and appends a pair for
 * each. There is none if its depth is a guess. */
static void compare(saga_exposure_pair *to, const saga_pictures *p,
                    saga_sample s, const double at[2])
{
    const saga_source_view *const views = p->capture->views;
    double own[3], other[3], uv[2], x[3], z;
    saga_plane_found found;
    saga_plane_sweep w;
    saga_patch patch;

    /* Find the depth at which the pixel's patch looks most like the other
     * views. */
    if (!saga_plane_begin(&w, p, s.view, s.frame, at[0], at[1]) ||
        !sum_of(own, &w.own) || !saga_plane_find(&found, &w))
        return;
    saga_view_lift(views + s.view, w.uv, found.depth, x);
    /* Each of the nearest views that shows this point gives one pair. */
    for (int i = 0; i < w.n_near; i++) {
        if (!saga_view_project(views + w.near[i], x, uv, &z) ||
            !saga_patch_between(&patch, p, w.near[i], s.frame, uv[0], uv[1]) ||
            !sum_of(other, &patch))
            continue;
        to->a = s.view;
        to->b = w.near[i];
        for (int k = 0; k < 3; k++)
            to->log[k] = log(own[k] / other[k]);
        to++;
    }
}

/* Returns a training picture at random, of the moments alone: a camera has one
 * exposure, which a few of its pictures tell as well as all. */
static saga_sample pick(const saga_pictures *p, saga_rng r, uint64_t draw)
{
    saga_sample s = saga_pictures_pick(p, r, draw);

    s.frame = saga_capture_near(p->capture, s.view,
                                saga_pictures_moment_of(p, s.frame));
    return s;
}

static void compare_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_rng r = saga_rng_stream(j->seed, FLAT_RNG_EXPOSURE);
    const saga_range of = saga_part(N_PIXELS, SAGA_PLANE_PART, part);

    for (size_t i = of.begin; i < of.end; i++) {
        /* Each pixel has three random numbers (picture, u, v), and each pass
         * looks at other pixels. The result does not depend on the number of
         * threads. */
        const uint64_t k = 3 * ((uint64_t)j->pass * N_PIXELS + i);
        const saga_sample s = pick(j->pictures, r, k);
        const saga_source_view *const v = j->pictures->capture->views + s.view;
        const double at[2] = { saga_rng_double(r, k + 1) * v->width,
                               saga_rng_double(r, k + 2) * v->height };

        compare(j->at + i * SAGA_PLANE_NEAR, j->pictures, s, at);
    }
}

/* Makes the pairs of a pass. */
static void compare_all(saga_exposure_pairs *pairs, job *j)
{
    memset(j->at, 0, N_PIXELS * SAGA_PLANE_NEAR * sizeof *j->at);
    saga_parallel(&(saga_tasks){ .run = compare_part,
                                 .user = j,
                                 .n = saga_n_parts(N_PIXELS, SAGA_PLANE_PART),
                                 .ns = (double)SAGA_PLANE_NS * N_PIXELS });
    /* Unused entries are zero, and so compare a view with itself; they are
     * removed, and the order is kept. */
    pairs->at = j->at;
    pairs->n = 0;
    for (size_t i = 0; i < N_PIXELS * SAGA_PLANE_NEAR; i++)
        if (j->at[i].a != j->at[i].b)
            pairs->at[pairs->n++] = j->at[i];
}

/* Sets the exposures of p. log_of is scratch of three numbers per view. */
static bool find(saga_pictures *p, job *j, double *log_of, saga_error *error)
{
    const size_t n = 3 * (size_t)p->capture->n_views;
    saga_exposure_pairs pairs = { .n_views = p->capture->n_views,
                                  .train = p->train,
                                  .n_train = p->n_train };
    double before = 0;

    for (j->pass = 0; j->pass < N_PASSES; j->pass++) {
        /* The factors of earlier passes are applied to the pairs, so that the
         * solution is the factor that is still missing. */
        compare_all(&pairs, j);
        memset(log_of, 0, n * sizeof *log_of);
        if (j->pass == 0)
            before = saga_exposure_left(&pairs, log_of);
        if (!saga_exposure_solve(log_of, &pairs, error))
            return false;
        /* The exposures stay exactly 1 if the cameras agree already, or if the
         * factors explain too little of the differences. */
        if (j->pass == 0 &&
            !(saga_exposure_span(log_of, &pairs) > WORTH_LOOKING &&
              saga_exposure_left(&pairs, log_of) < LEFT_PART * before))
            return true;
        for (size_t i = 0; i < n; i++)
            p->exposure[i] *= exp(log_of[i]);
    }
    for (size_t i = 0; i < n; i++)
        log_of[i] = log(p->exposure[i]);
    if (!(saga_exposure_span(log_of, &pairs) > WORTH_IT))
        for (size_t i = 0; i < n; i++)
            p->exposure[i] = 1;
    return true;
}

bool saga_exposure_find(saga_pictures *p, uint64_t seed, saga_error *error)
{
    static const char what[] = "the exposures";
    job j = { .pictures = p,
              .seed = seed,
              .at = saga_alloc(N_PIXELS * SAGA_PLANE_NEAR, sizeof *j.at, what,
                               error) };
    double *const log_of = saga_alloc(3 * (size_t)p->capture->n_views,
                                      sizeof *log_of, what, error);
    const bool ok = j.at && log_of &&
                    (p->n_train < 2 || find(p, &j, log_of, error));

    free(j.at);
    free(log_of);
    return ok;
}
