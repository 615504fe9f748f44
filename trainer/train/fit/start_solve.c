/* SPDX-License-Identifier: MIT
 *
 * Finds basis, mean and features that come nearest to the wanted attributes
 * (start.h), by weighted least squares. Basis and features are fitted
 * alternately, each while the other is fixed.
 */
#include "start_state.h"

#include "threads.h"

#include <math.h>
#include <string.h>

/* Primitives whose features are fitted in one task, and nanoseconds for
 * each. */
enum { CODES = 32, CODE_NS = 5000 };

/* Rounds of the alternation. */
enum { N_TURNS = 6 };

/* The least weight of a primitive's error, as a part of the mean weight. A
 * primitive that no picture shows still gets sensible attributes, since later
 * iterations may make it visible. */
#define LEAST_WEIGHT 0.1

/* The weight of a feature's square over its variance, in squared errors of a
 * rounded feature (price step^2 / 12). It keeps a primitive from taking extreme
 * features for a small gain. */
#define PRIOR 100

/* The deviation of the largest feature is kept between one step and this.
 * Otherwise, with bits that are almost free or very dear, weights of the
 * networks would exceed their formats. */
#define MOST_DEVIATION 4.0

void saga_start_raise_weights(saga_start *x)
{
    for (size_t k = 0; k < x->d; k++) {
        double sum = 0;

        for (size_t i = 0; i < x->n; i++)
            sum += x->weight[i * x->d + k];
        for (size_t i = 0; i < x->n; i++)
            /* The last term is for dimensions that no picture shows:
             * first_basis divides by the sum of their weights. */
            x->weight[i * x->d + k] += LEAST_WEIGHT * sum / (double)x->n +
                                       1e-30;
    }
}

/* Finds principal axes to start with. Each dimension is scaled by the root of
 * its mean weight, and each primitive counts by the mean of its weights
 * relative to these. */
static void first_basis(saga_start *x)
{
    double w[SAGA_LINEAR_MOST] = { 0 };
    saga_matrix c, v;

    memset(c, 0, sizeof c);
    for (size_t k = 0; k < x->d; k++) {
        double sum = 0;

        for (size_t i = 0; i < x->n; i++) {
            w[k] += x->weight[i * x->d + k];
            sum += x->weight[i * x->d + k] * x->wanted[i * x->d + k];
        }
        /* w turns from the sum of the weights into the root of their mean. */
        x->mean[k] = sum / w[k];
        w[k] = sqrt(w[k] / (double)x->n);
    }
    /* The covariance counts each primitive `say` times, which is its weight. */
    for (size_t i = 0; i < x->n; i++) {
        double e[SAGA_LINEAR_MOST], say = 0;

        for (size_t k = 0; k < x->d; k++) {
            say += x->weight[i * x->d + k] / (w[k] * w[k]);
            e[k] = w[k] * (x->wanted[i * x->d + k] - x->mean[k]);
        }
        for (size_t k = 0; k < x->d; k++)
            for (size_t j = 0; j < x->d; j++)
                c[k][j] += say * e[k] * e[j];
    }
    saga_eigen(v, c, x->d);
    for (size_t k = 0; k < x->d; k++)
        for (size_t j = 0; j < x->f; j++)
            /* The strongest axes come first. 1 / w returns to the units of the
             * dimensions. */
            x->basis[k][j] = v[k][j] / w[k];
}

typedef struct {
    saga_start *x;
    const double *ridge;
} coding;

static void fit_code(const coding *c, size_t i)
{
    saga_start *const x = c->x;
    double *const b = x->code + i * x->f, trace = 0;
    saga_matrix a;

    memset(a, 0, sizeof a);
    memset(b, 0, x->f * sizeof *b);
    /* The normal equations of sum_k w_k (e_k - (B f)_k)^2 + sum_j ridge_j f_j^2
     * are (B' W B + ridge) f = B' W e. The solver reads only the lower
     * triangle. */
    for (size_t k = 0; k < x->d; k++) {
        const double w = x->weight[i * x->d + k];
        const double e = x->wanted[i * x->d + k] - x->mean[k];

        for (size_t j = 0; j < x->f; j++) {
            b[j] += w * x->basis[k][j] * e;
            for (size_t l = 0; l <= j; l++)
                a[j][l] += w * x->basis[k][j] * x->basis[k][l];
        }
    }
    /* A thousandth of the mean diagonal keeps the system solvable where the
     * weights of a primitive hardly depend on some feature. */
    for (size_t j = 0; j < x->f; j++)
        trace += a[j][j];
    for (size_t j = 0; j < x->f; j++)
        a[j][j] += c->ridge ? c->ridge[j] : 1e-3 * trace / (double)x->f;
    saga_solve(a, b, x->f);
}

static void code_part(void *user, size_t part)
{
    const coding *const c = user;
    const saga_range of = saga_part(c->x->n, CODES, part);

    for (size_t i = of.begin; i < of.end; i++)
        fit_code(c, i);
}

/* Fits the features of every primitive with the basis fixed. ridge (f): the
 * price of each feature's square; NULL: almost none. */
static void fit_codes(saga_start *x, const double *ridge)
{
    coding c = { x, ridge };

    saga_parallel(&(saga_tasks){ .run = code_part,
                                 .user = &c,
                                 .n = saga_n_parts(x->n, CODES),
                                 .ns = (double)CODE_NS * (double)x->n });
}

/* Fits, with the features fixed, the basis and the mean of every dimension. */
static void fit_basis(saga_start *x)
{
    const size_t n = x->f + 1;

    for (size_t k = 0; k < x->d; k++) {
        double b[SAGA_LINEAR_MOST] = { 0 }, z[SAGA_LINEAR_MOST];
        saga_matrix a;

        memset(a, 0, sizeof a);
        /* Regression on (features, 1); the last coefficient is the mean. */
        z[x->f] = 1;
        for (size_t i = 0; i < x->n; i++) {
            const double w = x->weight[i * x->d + k];

            memcpy(z, x->code + i * x->f, x->f * sizeof *z);
            for (size_t j = 0; j < n; j++) {
                b[j] += w * z[j] * x->wanted[i * x->d + k];
                for (size_t l = 0; l <= j; l++)
                    a[j][l] += w * z[j] * z[l];
            }
        }
        for (size_t j = 0; j < n; j++)
            /* Linearly dependent features would make the matrix singular. */
            a[j][j] *= 1 + 1e-6;
        saga_solve(a, b, n);
        memcpy(x->basis[k], b, x->f * sizeof *b);
        x->mean[k] = b[x->f];
    }
}

/* Changes the features by a linear map: code <- forth code, basis <- basis
 * back, where back is the inverse of forth. Rows of forth are the new
 * features. */
static void change(saga_start *x, saga_matrix forth, saga_matrix back)
{
    double y[SAGA_LINEAR_MOST];

    for (size_t i = 0; i < x->n; i++) {
        double *const c = x->code + i * x->f;

        /* The new features are y = forth c. The products do not change, since B
         * c = (B back) (forth c). */
        for (size_t j = 0; j < x->f; j++) {
            y[j] = 0;
            for (size_t l = 0; l < x->f; l++)
                y[j] += forth[j][l] * c[l];
        }
        memcpy(c, y, x->f * sizeof *c);
    }
    for (size_t k = 0; k < x->d; k++) {
        for (size_t j = 0; j < x->f; j++) {
            y[j] = 0;
            for (size_t l = 0; l < x->f; l++)
                y[j] += x->basis[k][l] * back[l][j];
        }
        memcpy(x->basis[k], y, x->f * sizeof *y);
    }
}

/* Scales and rotates the features so that a unit error of each costs `price`,
 * on average over the primitives. */
static void scale(saga_start *x, double price)
{
    saga_matrix g, v, forth, back;

    memset(g, 0, sizeof g);
    /* G = B' W B / price, where W is the mean of the weights: an error e of the
     * features costs e' G e prices. */
    for (size_t k = 0; k < x->d; k++) {
        double w = 0;

        for (size_t i = 0; i < x->n; i++)
            w += x->weight[i * x->d + k] / ((double)x->n * price);
        for (size_t j = 0; j < x->f; j++)
            for (size_t l = 0; l < x->f; l++)
                g[j][l] += w * x->basis[k][j] * x->basis[k][l];
    }
    saga_eigen(v, g, x->f);
    for (size_t j = 0; j < x->f; j++)
        for (size_t l = 0; l < x->f; l++) {
            /* With G = V D V', forth = D^(1/2) V' and back = V D^(-1/2) give
             * back' G back = 1. The floor is for directions that draw
             * nothing. */
            const double root = sqrt(fmax(g[l][l], 1e-12 * g[0][0]));

            forth[l][j] = v[j][l] * root;
            back[j][l] = v[j][l] / root;
        }
    change(x, forth, back);
}

/* Rotates the features so that they are uncorrelated, the one with the largest
 * variance first, and subtracts their mean. Sets variance (f). */
static void decorrelate(saga_start *x, double *variance)
{
    double mean[SAGA_LINEAR_MOST] = { 0 };
    saga_matrix c, v, forth;

    memset(c, 0, sizeof c);
    for (size_t i = 0; i < x->n; i++)
        for (size_t j = 0; j < x->f; j++)
            mean[j] += x->code[i * x->f + j] / (double)x->n;
    /* The mean of the features moves into the mean of the dimensions. */
    for (size_t k = 0; k < x->d; k++)
        for (size_t j = 0; j < x->f; j++)
            x->mean[k] += x->basis[k][j] * mean[j];
    for (size_t i = 0; i < x->n; i++) {
        double *const y = x->code + i * x->f;

        for (size_t j = 0; j < x->f; j++)
            y[j] -= mean[j];
        for (size_t j = 0; j < x->f; j++)
            for (size_t l = 0; l < x->f; l++)
                c[j][l] += y[j] * y[l] / (double)x->n;
    }
    /* The codes are rotated by the transpose of v; v is its inverse. A rotation
     * preserves the effect of the scaling before, that an error costs the same
     * in all directions. */
    saga_eigen(v, c, x->f);
    for (size_t j = 0; j < x->f; j++)
        for (size_t l = 0; l < x->f; l++)
            forth[l][j] = v[j][l];
    change(x, forth, v);
    for (size_t j = 0; j < x->f; j++)
        variance[j] = c[j][j];
}

static void limit_codes(saga_start *x)
{
    for (size_t i = 0; i < x->n * x->f; i++)
        x->code[i] = fmin(fmax(x->code[i], -SAGA_MOST_FEATURE),
                          SAGA_MOST_FEATURE);
}

/* Removes features that are always coded as 0, because their deviation is below
 * a thousandth of a step. Their weights would otherwise exceed all formats. */
static void drop_idle(saga_start *x, const double *variance, double step)
{
    for (size_t k = 0; k < x->f; k++)
        for (size_t i = 0; i < x->d && variance[k] < 1e-6 * step * step; i++)
            x->basis[i][k] = 0;
}

void saga_start_solve(saga_start *x, double price, double step)
{
    double ridge[SAGA_LINEAR_MOST], most;

    /* Basis and features are fitted alternately. */
    first_basis(x);
    for (int i = 0; i < N_TURNS; i++) {
        if (i)
            fit_basis(x);
        fit_codes(x, NULL);
    }
    /* The features get units in which a step is worth its bits. ridge receives
     * their variances, the largest first. */
    scale(x, price);
    decorrelate(x, ridge);
    most = fmin(fmax(ridge[0], step * step), MOST_DEVIATION * MOST_DEVIATION);
    if (ridge[0] > 1e-24 && (ridge[0] < most || ridge[0] > most)) {
        /* Features are proportional to 1 / sqrt(price), variances to 1 / price,
         * so this sets the largest variance to `most`. */
        price *= ridge[0] / most;
        scale(x, price);
        decorrelate(x, ridge);
    }
    drop_idle(x, ridge, step);
    /* The final features have a prior with their own variance, PRIOR (price
     * step^2 / 12) f^2 / variance. */
    for (size_t k = 0; k < x->f; k++)
        ridge[k] = PRIOR * price / (12 / (step * step) * (ridge[k] + 1e-6));
    fit_codes(x, ridge);
    limit_codes(x);
}
