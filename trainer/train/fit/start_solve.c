/* SPDX-License-Identifier: MIT
 *
 * Basis, mean and features that come nearest to what is wanted of primitives
 * (start.h), by weighted least squares: the basis while features stand still,
 * features while the basis does.
 */
#include "start_state.h"

#include "threads.h"

#include <math.h>
#include <string.h>

/* Primitives whose features a task fits; nanoseconds that a thread takes for
 * one. */
enum { CODES = 32, CODE_NS = 5000 };

/* Turns of basis and features, each of which is fitted while the other stands
 * still. */
enum { N_TURNS = 6 };

/* The weight of a feature's square over its variance beside its primitive's
 * error, in errors of a rounded feature (price step^2 / 12): a primitive is
 * not worth far-fetched values. */
#define PRIOR 100

/* Bits that cost next to nothing do not make features larger than this standard
 * deviation, nor dear ones smaller than a step, or weights would be beyond all
 * formats. */
#define MOST_DEVIATION 4.0

/* Finds principal axes where each dimension is scaled by the root of its mean
 * weight, and each primitive counts by the mean of its weights over those. */
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
        /* From a sum, w becomes the root of the mean weight. */
        x->mean[k] = sum / w[k];
        w[k] = sqrt(w[k] / (double)x->n);
    }
    /* The covariance, each primitive times its say. */
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
            /* The strongest axes come first; 1 / w leads back into the
             * dimensions' own units. */
            x->basis[k][j] = v[k][j] / w[k];
}

typedef struct { saga_start *x; const double *ridge; } coding;

static void fit_code(const coding *c, size_t i)
{
    saga_start *const x = c->x;
    double *const b = x->code + i * x->f, trace = 0;
    saga_matrix a;

    memset(a, 0, sizeof a);
    memset(b, 0, x->f * sizeof *b);
    /* Normal equations of sum_k w_k (e_k - (B f)_k)^2 + sum_j ridge_j f_j^2,
     * that is (B' W B + ridge) f = B' W e. The solver reads the lower triangle
     * alone. */
    for (size_t k = 0; k < x->d; k++) {
        const double w = x->weight[i * x->d + k];
        const double e = x->wanted[i * x->d + k] - x->mean[k];

        for (size_t j = 0; j < x->f; j++) {
            b[j] += w * x->basis[k][j] * e;
            for (size_t l = 0; l <= j; l++)
                a[j][l] += w * x->basis[k][j] * x->basis[k][l];
        }
    }
    /* A thousandth of the mean diagonal keeps the system solvable where a
     * primitive's weights say nearly nothing about some feature. */
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

/* Fits the features of every primitive, given the basis. ridge (f): what the
 * square of each costs; NULL: next to nothing. */
static void fit_codes(saga_start *x, const double *ridge)
{
    coding c = { x, ridge };

    saga_parallel(&(saga_tasks){
        .run = code_part, .user = &c, .n = saga_n_parts(x->n, CODES),
        .ns = (double)CODE_NS * (double)x->n });
}

/* Fits basis and mean of every dimension, given the features. */
static void fit_basis(saga_start *x)
{
    const size_t n = x->f + 1;

    for (size_t k = 0; k < x->d; k++) {
        double b[SAGA_LINEAR_MOST] = { 0 }, z[SAGA_LINEAR_MOST];
        saga_matrix a;

        memset(a, 0, sizeof a);
        /* Regression on (features, 1): the last coefficient is the mean. */
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
            /* Features that depend on each other would make it singular. */
            a[j][j] *= 1 + 1e-6;
        saga_solve(a, b, n);
        memcpy(x->basis[k], b, x->f * sizeof *b);
        x->mean[k] = b[x->f];
    }
}

/* code <- forth code (rows: new features), basis <- basis back, with back the
 * inverse of forth. */
static void change(saga_start *x, saga_matrix forth, saga_matrix back)
{
    double y[SAGA_LINEAR_MOST];

    for (size_t i = 0; i < x->n; i++) {
        double *const c = x->code + i * x->f;

        /* Features y = forth c; the products stay what they were, since B c =
         * (B back) (forth c). */
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

/* Makes features whose unit errors cost `price` each on the mean of the
 * primitives. */
static void scale(saga_start *x, double price)
{
    saga_matrix g, v, forth, back;

    memset(g, 0, sizeof g);
    /* G = B' W B / price, W the mean weights: an error e of the features costs
     * e' G e in units of the price. */
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
            /* With G = V D V', forth D^(1/2) V' and back V D^(-1/2) give back'
             * G back = 1. The floor stands for directions that draw nothing. */
            const double root = sqrt(fmax(g[l][l], 1e-12 * g[0][0]));

            forth[l][j] = v[j][l] * root;
            back[j][l] = v[j][l] / root;
        }
    change(x, forth, back);
}

/* Makes features of mean 0 without correlation, that of the largest variance
 * first; variance (f). */
static void decorrelate(saga_start *x, double *variance)
{
    double mean[SAGA_LINEAR_MOST] = { 0 };
    saga_matrix c, v, forth;

    memset(c, 0, sizeof c);
    for (size_t i = 0; i < x->n; i++)
        for (size_t j = 0; j < x->f; j++)
            mean[j] += x->code[i * x->f + j] / (double)x->n;
    /* The part that the features have in common moves into the dimensions'
     * mean. */
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
    /* A rotation, with v as its inverse: what errors cost, which scale has made
     * the same in all directions, stays so. */
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

/* Leaves out features that never reach a step, and so are always coded as 0:
 * those whose deviation is a thousandth of one, before their weights leave all
 * formats. */
static void drop_idle(saga_start *x, const double *variance, double step)
{
    for (size_t k = 0; k < x->f; k++)
        for (size_t i = 0; i < x->d && variance[k] < 1e-6 * step * step; i++)
            x->basis[i][k] = 0;
}

void saga_start_solve(saga_start *x, double price, double step)
{
    double ridge[SAGA_LINEAR_MOST], most;

    /* Basis and features, in turns. */
    first_basis(x);
    for (int i = 0; i < N_TURNS; i++) {
        if (i)
            fit_basis(x);
        fit_codes(x, NULL);
    }
    /* Units that bits are worth; ridge takes the variances, the largest
     * first. */
    scale(x, price);
    decorrelate(x, ridge);
    most = fmin(fmax(ridge[0], step * step), MOST_DEVIATION * MOST_DEVIATION);
    if (ridge[0] > 1e-24 && (ridge[0] < most || ridge[0] > most)) {
        /* Features go with 1 / sqrt(price), variances with 1 / price, so that
         * this makes the largest one `most`. */
        price *= ridge[0] / most;
        scale(x, price);
        decorrelate(x, ridge);
    }
    drop_idle(x, ridge, step);
    /* The last features, with a prior of their own variance: PRIOR (price
     * step^2 / 12) f^2 / variance. */
    for (size_t k = 0; k < x->f; k++)
        ridge[k] = PRIOR * price /
                   (12 / (step * step) * (ridge[k] + 1e-6));
    fit_codes(x, ridge);
    limit_codes(x);
}
