/* SPDX-License-Identifier: MIT */
#include "weight_round.h"

#include "alloc.h"
#include "threads.h"

#include <math.h>
#include <stdint.h>
#include <stdlib.h>

/* This part of H's mean diagonal is added to it. Otherwise errors would be
 * moved to directions that no input has by now. */
#define DAMPING 1e-3

/* The columns in the reverse order of rounding: first the bias, then by
 * ascending diagonal of H. */
typedef struct {
    size_t n;       /* n_in + 1 */
    size_t *order;  /* (n) column at each position */
    double *h;      /* (n, n) lower triangle of H, with columns in
                     * their original order */
    double *factor; /* (n, n) lower triangle: factor factor^T = H,
                     * in `order` */
    double *follow; /* (n, n) row i: the change of columns before i
                     * for a unit error of column i */
} work;

static double input_at(const saga_weight_round_input *in, size_t p, size_t c)
{
    return c < in->n_in ? (double)in->x[p * in->stride + c] : 1;
}

/* Nanoseconds for a multiplication. */
enum { PRODUCT_NS = 1 };

typedef struct {
    double *h;
    const saga_weight_round_input *in;
} gathering;

static void gather_row(void *user, size_t a)
{
    const gathering *const g = user;
    const saga_weight_round_input *const in = g->in;
    double *const row = g->h + a * (in->n_in + 1);
    size_t p, b;

    for (p = 0; p < in->points; p++) {
        const double x = input_at(in, p, a) / (double)in->points;

        /* H is symmetric, so the lower triangle is enough. */
        for (b = 0; b <= a && x != 0; b++)
            row[b] += x * input_at(in, p, b);
    }
}

static void gather(double *h, const saga_weight_round_input *in)
{
    const size_t n = in->n_in + 1;
    gathering g = { h, in };

    saga_parallel(&(saga_tasks){ .run = gather_row,
                                 .user = &g,
                                 .n = n,
                                 .ns = PRODUCT_NS * (double)(n * n) *
                                       (double)in->points / 2 });
}

static void damp(double *h, size_t n)
{
    double sum = 0;
    size_t i;

    for (i = 0; i < n; i++)
        sum += h[i * (n + 1)];
    for (i = 0; i < n; i++)
        h[i * (n + 1)] += DAMPING * sum / (double)n + 1e-12;
}

static void sort_columns(size_t *order, const double *h, size_t n)
{
    size_t i, k;

    /* The bias is first, so it is rounded last: its input is always 1, so it
     * can compensate for the other errors. */
    order[0] = n - 1;
    for (i = 0; i + 1 < n; i++) {
        for (k = i + 1; k > 1 && h[order[k - 1] * (n + 1)] > h[i * (n + 1)];
             k--)
            order[k] = order[k - 1];
        order[k] = i;
    }
}

/* Computes the Cholesky factor. */
static void factorise(work *w)
{
    const size_t n = w->n;
    double *const f = w->factor;
    size_t i, j, k;

    for (i = 0; i < n; i++)
        for (j = 0; j <= i; j++) {
            const size_t a = w->order[i], b = w->order[j];
            double s = a > b ? w->h[a * n + b] : w->h[b * n + a];

            for (k = 0; k < j; k++)
                s -= f[i * n + k] * f[j * n + k];
            /* Damping keeps pivots positive; the limit is for rounding errors
             * of tiny ones. */
            f[i * n + j] = i == j ? sqrt(fmax(s, 1e-15)) : s / f[j * n + j];
        }
}

/* Finds the regression of input i on those before it, z = H_<<^-1 H_<i. With
 * H_<i = F f_i and H_<< = F F^T, it solves F^T z = f_i. */
static void regress(work *w)
{
    const size_t n = w->n;
    size_t i, k, j;

    for (i = 0; i < n; i++) {
        double *const z = w->follow + i * n;

        /* Back substitution through F^T, whose row k is column k of F. */
        for (k = i; k-- > 0;) {
            double s = w->factor[i * n + k];

            for (j = k + 1; j < i; j++)
                s -= w->factor[j * n + k] * z[j];
            z[k] = s / w->factor[k * n + k];
        }
    }
}

/* Rounds `row`, the n parameters of a row in `order`, with `times` the input's
 * steps. Returns the largest weight in steps. */
static double round_ordered(double *row, const work *w,
                            const saga_weight_round_input *in, double times)
{
    double most = 0;
    size_t i, k;

    for (i = w->n; i-- > 0;) {
        const bool is_weight = w->order[i] < in->n_in;
        const double step = times * (is_weight ? in->step : in->bias_step);
        const double q = floor(row[i] / step + 0.5);

        /* For an error e of input i, e^T H e is least if the inputs before it
         * have errors -z e. */
        for (k = 0; k < i; k++)
            row[k] += (row[i] - step * q) * w->follow[i * w->n + k];
        row[i] = step * q;
        most = fmax(most, is_weight ? fabs(q) : 0);
    }
    return most;
}

/* Rounds one row. `row` (n) is scratch for its parameters in `order`. */
static void round_row(real *weight, real *bias, double *row, const work *w,
                      const saga_weight_round_input *in)
{
    double times = 0.5, most;
    size_t i;

    do {
        /* If a weight is too large, the whole row is rounded again with 2, 4,
         * ... times the input's steps. */
        times *= 2;
        for (i = 0; i < w->n; i++)
            row[i] = w->order[i] < in->n_in ? (double)weight[w->order[i]]
                                            : (double)*bias;
        most = round_ordered(row, w, in, times);
    } while (in->most && most > in->most);
    for (i = 0; i < w->n; i++)
        *(w->order[i] < in->n_in ? &weight[w->order[i]] : bias) = (real)row[i];
}

bool saga_weight_round(real *weight, real *bias,
                       const saga_weight_round_input *in, saga_error *error)
{
    static const char purpose[] = "rounding weights";
    const size_t n = in->n_in + 1;
    work w = { .n = n };
    double *const block = saga_calloc(3 * n * n + n, sizeof *block, purpose,
                                      error);
    size_t r;

    w.order = saga_calloc(n, sizeof *w.order, purpose, error);
    if (!block || !w.order) {
        free(block);
        free(w.order);
        return false;
    }
    w.h = block + n;
    w.factor = w.h + n * n;
    w.follow = w.factor + n * n;
    /* H, its factor and the regressions are the same for all rows of the
     * layer. */
    gather(w.h, in);
    damp(w.h, n);
    sort_columns(w.order, w.h, n);
    factorise(&w);
    regress(&w);
    for (r = 0; r < in->n_out; r++)
        round_row(weight + r * in->n_in, bias + r, block, &w, in);
    free(block);
    free(w.order);
    return true;
}
