/* SPDX-License-Identifier: MIT */
#include "exposure.h"

#include "alloc.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* -------------------------------------------- of a place that may be hidden */

#define DISPLAY_GAMMA 2.2

/* Tells whether a luma is usable: very dark pixels are noisy, bright ones may
 * be saturated. */
static bool tells(double luma)
{
    return luma > 16.0 && luma < 240.0;
}

/* Returns the luma with the weights of BT.709. */
static double luma_of(const double rgb[3])
{
    return 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2];
}

bool saga_exposure_compare(double *stops, const double rgb[3],
                           const double others[3])
{
    const double a = luma_of(rgb), b = luma_of(others);
    if (!tells(a) || !tells(b))
        return false;
    *stops = DISPLAY_GAMMA * log2(a / b);
    return true;
}

double saga_colour_apart(const double a[3], const double b[3], bool swapped)
{
    double sum = 0.0;
    for (int k = 0; k < 3; k++)
        sum += fabs(a[swapped ? 2 - k : k] - b[k]) / 3.0;
    return sum;
}

double saga_exposure_gain(double stops)
{
    return exp2(stops / DISPLAY_GAMMA);
}

/* ---------------------------------------------------- of patches that match */

/* The factor of a view is the weighted mean of the factors that its pairs ask
 * for while the other views' factors are fixed, computed repeatedly. Weights
 * are inverse to the residual, which approximates the L1 norm, because some
 * pairs show different surfaces. */
enum {
    N_ROUNDS = 60,
    LEAST_PAIRS = 40 /* least number of pairs of a view for a factor */
};

#define UNEXPLAINED 0.01 /* residual at which the weight is halved */
#define WRONG 0.2        /* larger residuals count as this one */

typedef struct solver {
    const saga_exposure_pairs *pairs;
    int *n_of;   /* (n_views) number of pairs */
    double *sum; /* (n_views, 2) weighted sum and sum of weights */
} solver;

static void count_pairs(const solver *s)
{
    for (size_t i = 0; i < s->pairs->n; i++) {
        s->n_of[s->pairs->at[i].a]++;
        s->n_of[s->pairs->at[i].b]++;
    }
}

/* Updates the factors of channel k once; x are their logarithms. */
static void improve(const solver *s, double *x, int k)
{
    const size_t n_views = (size_t)s->pairs->n_views;
    memset(s->sum, 0, 2 * n_views * sizeof *s->sum);
    for (size_t i = 0; i < s->pairs->n; i++) {
        const saga_exposure_pair *const d = s->pairs->at + i;
        /* The residual is 0 if a exp(x_a) = b exp(x_b). */
        const double left = d->log[k] + x[3 * d->a] - x[3 * d->b];
        const double weight = 1 / (fabs(left) + UNEXPLAINED);

        s->sum[2 * d->a] += weight * (x[3 * d->a] - left);
        s->sum[2 * d->a + 1] += weight;
        s->sum[2 * d->b] += weight * (x[3 * d->b] + left);
        s->sum[2 * d->b + 1] += weight;
    }
    /* Each view moves half of the way, since both views of a pair move. */
    for (size_t v = 0; v < n_views; v++)
        if (s->n_of[v] >= LEAST_PAIRS)
            x[3 * v] = (x[3 * v] + s->sum[2 * v] / s->sum[2 * v + 1]) / 2;
}

/* Makes the mean logarithm over training views 0, because pairs do not
 * determine a factor that all views share. */
static void centre(double *x, const saga_exposure_pairs *p)
{
    double sum = 0;
    for (int k = 0; k < p->n_train; k++)
        sum += x[3 * p->train[k]];
    for (int k = 0; k < p->n_train; k++)
        x[3 * p->train[k]] -= sum / p->n_train;
}

bool saga_exposure_solve(double *log, const saga_exposure_pairs *pairs,
                         saga_error *error)
{
    static const char what[] = "the exposures";
    const size_t n = (size_t)pairs->n_views;
    const solver s = { .pairs = pairs,
                       .n_of = saga_calloc(n, sizeof *s.n_of, what, error),
                       .sum = saga_alloc(2 * n, sizeof *s.sum, what, error) };
    const bool ok = s.n_of && s.sum;

    memset(log, 0, 3 * n * sizeof *log);
    if (ok)
        count_pairs(&s);
    for (int k = 0; ok && k < 3; k++) {
        for (int i = 0; i < N_ROUNDS; i++)
            improve(&s, log + k, k);
        centre(log + k, pairs);
    }
    free(s.n_of);
    free(s.sum);
    return ok;
}

double saga_exposure_left(const saga_exposure_pairs *pairs, const double *log)
{
    double sum = 0;
    for (size_t i = 0; i < pairs->n; i++) {
        const saga_exposure_pair *const d = pairs->at + i;
        for (int k = 0; k < 3; k++)
            sum += fmin(fabs(d->log[k] + log[3 * d->a + k] - log[3 * d->b + k]),
                        WRONG);
    }
    return sum;
}

static double span_of(const double *x, const saga_exposure_pairs *p)
{
    double lo = INFINITY, hi = -INFINITY;
    for (int k = 0; k < p->n_train; k++) {
        lo = fmin(lo, x[3 * p->train[k]]);
        hi = fmax(hi, x[3 * p->train[k]]);
    }
    return hi - lo;
}

double saga_exposure_span(const double *log, const saga_exposure_pairs *pairs)
{
    double widest = 0;
    for (int k = 0; k < 3; k++)
        widest = fmax(widest, span_of(log + k, pairs));
    return widest;
}

/* ------------------------------------------------------- of the same pixels */

size_t saga_exposure_add(saga_exposure_sums sums[3], const uint8_t *made,
                         const uint8_t *truth, const uint8_t *mask, size_t n)
{
    size_t counting = 0;

    for (size_t i = 0; i < n; i++) {
        const uint8_t *const m = made + 3 * i, *const t = truth + 3 * i;

        if (mask && !mask[i])
            continue;
        for (size_t k = 0; k < 3; k++) {
            sums[k].made_made += (uint64_t)(m[k] * m[k]);
            sums[k].made_true += (uint64_t)(m[k] * t[k]);
            sums[k].true_true += (uint64_t)(t[k] * t[k]);
        }
        counting++;
    }
    return counting;
}

double saga_exposure_error(const saga_exposure_sums sums[3])
{
    double error = 0;
    for (size_t k = 0; k < 3; k++) {
        const double both = (double)sums[k].made_true;

        /* The sum of (f m - t)^2 is least at f = (m t) / (m m), where it is t t
         * - (m t)^2 / (m m). */
        error += (double)sums[k].true_true;
        if (sums[k].made_made > 0)
            error -= both * both / (double)sums[k].made_made;
    }
    return error;
}
