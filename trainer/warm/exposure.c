/* SPDX-License-Identifier: MIT
 *
 * Pixels at random, whose depth a plane sweep finds, are compared with what
 * other views see of their place. A view's factor is then the weighted mean of
 * what its comparisons ask for, the others' factors given, again and again;
 * weights fall with what is left unexplained, as the L1 norm's do, since some
 * comparisons are of different surfaces.
 */
#include "exposure.h"

#include "alloc.h"
#include "flat_state.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum {
    N_PIXELS = 2000,
    N_PASSES = 3,        /* matches are better once tones agree */
    N_ROUNDS = 60,
    LEAST_RATIOS = 40    /* of a view, to believe in its factor */
};

#define UNEXPLAINED 0.01 /* whose weight is half of the best */
#define WORTH_IT 0.03    /* logarithms that differ by that */
#define WRONG 0.2        /* what differs by more counts as that */
#define UNEXPLAINED_PART 0.8 /* of all differences may be left; where more is,
                              * factors follow wrong matches */

/* View a saw a place brighter than view b by these logarithms. */
typedef struct comparison { int a, b; double log[3]; } comparison;

typedef struct comparisons {
    comparison *at;      /* (N_PIXELS, SAGA_FLAT_NEAR), then close together */
    size_t n;
    int *n_of;           /* (views) */
    double *log;         /* (views, 3) of the factors found so far */
    double *sum;         /* (views, 2) scratch: weighted sum, weights */
} comparisons;

typedef struct { comparisons *c; const saga_flat *f; int pass; } job;

static void compare_part(void *user, size_t part)
{
    const job *const t = user;
    const saga_flat *const f = t->f;
    const saga_pictures *const p = f->pictures;
    const saga_rng r = saga_rng_stream(f->o.seed, FLAT_RNG_EXPOSURE);
    const saga_range of = saga_part(N_PIXELS, SAGA_FLAT_LOOKS, part);

    for (size_t i = of.begin; i < of.end; i++) {
        /* Three random numbers for each pixel (picture, u, v), and other pixels
         * in each pass; what is seen does not depend on threads. */
        const uint64_t k = 3 * ((uint64_t)t->pass * N_PIXELS + i);
        const saga_sample s = saga_pictures_pick(p, r, k);
        const saga_shot *const v = p->capture->views + s.view;
        comparison *const to = t->c->at + i * SAGA_FLAT_NEAR;
        saga_flat_ratio ratio[SAGA_FLAT_NEAR];
        const int n = saga_flat_compare(
            f, s.view, s.frame, saga_rng_double(r, k + 1) * v->width,
            saga_rng_double(r, k + 2) * v->height, ratio);

        for (int j = 0; j < n; j++) {
            to[j].a = s.view;
            to[j].b = ratio[j].view;
            memcpy(to[j].log, ratio[j].log, sizeof to[j].log);
        }
    }
}

static void compare_all(comparisons *c, const saga_flat *f, int pass)
{
    job j = { c, f, pass };

    memset(c->at, 0, N_PIXELS * SAGA_FLAT_NEAR * sizeof *c->at);
    saga_parallel(&(saga_tasks){
        .run = compare_part, .user = &j,
        .n = saga_n_parts(N_PIXELS, SAGA_FLAT_LOOKS),
        .ns = (double)SAGA_FLAT_LOOK_NS * N_PIXELS });
}

static void gather(comparisons *c, size_t n_views)
{
    c->n = 0;
    memset(c->n_of, 0, n_views * sizeof *c->n_of);
    /* Places that were not filled are zeros, with a view compared to itself.
     * Those left close up, in their order. */
    for (size_t i = 0; i < N_PIXELS * SAGA_FLAT_NEAR; i++)
        if (c->at[i].a != c->at[i].b) {
            c->n_of[c->at[i].a]++;
            c->n_of[c->at[i].b]++;
            c->at[c->n++] = c->at[i];
        }
}

/* One round of the weighted means of a channel; x are the logarithms. */
static void improve(comparisons *c, double *x, int k, size_t n_views)
{
    memset(c->sum, 0, 2 * n_views * sizeof *c->sum);
    for (size_t i = 0; i < c->n; i++) {
        const comparison *const d = c->at + i;
        /* What is left unexplained is 0 where a exp(x_a) = b exp(x_b). */
        const double left = d->log[k] + x[3 * d->a] - x[3 * d->b];
        const double weight = 1 / (fabs(left) + UNEXPLAINED);

        c->sum[2 * d->a] += weight * (x[3 * d->a] - left);
        c->sum[2 * d->a + 1] += weight;
        c->sum[2 * d->b] += weight * (x[3 * d->b] + left);
        c->sum[2 * d->b + 1] += weight;
    }
    /* Half of the way, since both ends of a comparison go it. */
    for (size_t v = 0; v < n_views; v++)
        if (c->n_of[v] >= LEAST_RATIOS)
            x[3 * v] = (x[3 * v] + c->sum[2 * v] / c->sum[2 * v + 1]) / 2;
}

/* Returns what the comparisons differ by in all, given the factors x. */
static double difference(const comparisons *c, const double *x)
{
    double sum = 0;

    for (size_t i = 0; i < c->n; i++)
        for (int k = 0; k < 3; k++)
            sum += fmin(fabs(c->at[i].log[k] + x[3 * c->at[i].a + k] -
                             x[3 * c->at[i].b + k]), WRONG);
    return sum;
}

static void centre(double *x, const saga_pictures *p)
{
    double sum = 0;

    for (int k = 0; k < p->n_train; k++)
        sum += x[3 * p->train[k]];
    for (int k = 0; k < p->n_train; k++)
        x[3 * p->train[k]] -= sum / p->n_train;
}

static double span(const double *x, const saga_pictures *p)
{
    double lo = INFINITY, hi = -INFINITY;

    for (int k = 0; k < p->n_train; k++) {
        lo = fmin(lo, x[3 * p->train[k]]);
        hi = fmax(hi, x[3 * p->train[k]]);
    }
    return hi - lo;
}

static void find(comparisons *c, saga_pictures *p, const saga_flat *f)
{
    const size_t n = (size_t)p->capture->n_views;
    double widest = 0;
    double before = 0, after = 0;

    for (int pass = 0; pass < N_PASSES; pass++) {
        /* Comparisons see the tones with the factors of the passes before, so
         * c->log is what is still missing, and begins at 0. */
        compare_all(c, f, pass);
        gather(c, n);
        memset(c->log, 0, 3 * n * sizeof *c->log);
        if (pass == 0)
            before = difference(c, c->log);
        for (int k = 0; k < 3; k++) {
            for (int i = 0; i < N_ROUNDS; i++)
                improve(c, c->log + k, k, n);
            /* Comparisons say nothing of all views' common factor:
             * the mean camera has 1. */
            centre(c->log + k, p);
        }
        if (pass == 0)
            after = difference(c, c->log);
        for (size_t i = 0; i < 3 * n; i++)
            p->exposure[i] *= exp(c->log[i]);
    }
    for (size_t i = 0; i < 3 * n; i++)
        c->log[i] = log(p->exposure[i]);
    for (int k = 0; k < 3; k++)
        widest = fmax(widest, span(c->log + k, p));
    /* Exactly nothing where tones agree already, or where the factors explain
     * too little of the first pass's differences to be of tones. */
    if (!(widest > WORTH_IT && after < UNEXPLAINED_PART * before))
        for (size_t i = 0; i < 3 * n; i++)
            p->exposure[i] = 1;
}

bool saga_exposure_find(saga_pictures *p, uint64_t seed, saga_error *error)
{
    static const char what[] = "the exposures";
    const size_t n = (size_t)p->capture->n_views;
    saga_flat f = { .pictures = p, .o = { .seed = seed } };
    comparisons c = {
        .at = saga_alloc(N_PIXELS * SAGA_FLAT_NEAR, sizeof *c.at, what, error),
        .n_of = saga_alloc(n, sizeof *c.n_of, what, error),
        .log = saga_alloc(3 * n, sizeof *c.log, what, error),
        .sum = saga_alloc(2 * n, sizeof *c.sum, what, error)
    };
    const bool ok = c.at && c.n_of && c.log && c.sum;

    if (ok && p->n_train > 1)
        find(&c, p, &f);
    free(c.at);
    free(c.n_of);
    free(c.log);
    free(c.sum);
    return ok;
}
