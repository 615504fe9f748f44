/* SPDX-License-Identifier: MIT */
#include "weight_rate.h"

#include "normal.h"
#include "rng.h"

#include <math.h>
#include <string.h>

/* --- Tensors and steps --------------------------------------------------- */

static void add_tensor(saga_weights *w, int net, int layer, size_t at,
                       size_t rows, size_t cols)
{
    w->tensor[w->n++] = (saga_weight_tensor){ net, layer, at, rows, cols };
}

void saga_weights_list(saga_weights *w, const saga_net net[SAGA_N_NETS],
                       const real *params)
{
    int i, k;

    memset(w, 0, sizeof *w);
    for (i = SAGA_NET_FUSE_C; i < SAGA_NET_QUERY; i++)
        for (k = 0; k < net[i].n_layers && net[i].dim[0] > 0; k++) {
            const size_t rows = (size_t)net[i].dim[k + 1];

            add_tensor(w, i, k, (size_t)(net[i].w[k] - params), rows,
                       (size_t)net[i].dim[k]);
            add_tensor(w, i, k, (size_t)(net[i].b[k] - params), rows, 1);
        }
}

static double rms(const real *x, const saga_weight_tensor *t)
{
    const size_t n = t->rows * t->cols;
    double sum = 0;
    size_t i;

    for (i = 0; i < n; i++)
        sum += (double)x[t->at + i] * (double)x[t->at + i];
    return sqrt(sum / (double)n + 1e-12);
}

void saga_weights_start(saga_weights *w, const real *params)
{
    int t;

    for (t = 0; t < w->n; t++)
        w->log2_step[t] = (real)log2(rms(params, &w->tensor[t]) / 64);
}

int saga_weights_find(const saga_weights *w, int net, int layer)
{
    int t;

    for (t = 0; t < w->n; t += 2)
        if (w->tensor[t].net == net && w->tensor[t].layer == layer)
            return t;
    return -1;
}

double saga_weights_step(const saga_weights *w, int t)
{
    const double x = (double)w->log2_step[t];

    return exp2(t % 2 ? floor(x + 0.5) : x);
}

void saga_weights_noise(real *y, const real *x, const saga_weights *w,
                        int n_rounded, double noise, uint64_t seed)
{
    int t;

    for (t = 0; t < w->n; t++) {
        const size_t at = w->tensor[t].at;
        const size_t n = w->tensor[t].rows * w->tensor[t].cols;
        const saga_rng r = saga_rng_stream(seed, (uint64_t)t);
        const double size = t < n_rounded ? 0 : noise *
                            saga_weights_step(w, t);
        size_t i;

        for (i = 0; i < n; i++)
            y[at + i] = (real)((double)x[at + i] +
                               size * (saga_rng_double(r, i) - 0.5));
    }
}

void saga_weights_round(real *y, const real *x, const saga_weights *w)
{
    int t;

    for (t = 0; t < w->n; t++) {
        const size_t at = w->tensor[t].at;
        const size_t n = w->tensor[t].rows * w->tensor[t].cols;
        const double step = saga_weights_step(w, t);
        size_t i;

        for (i = at; i < at + n; i++)
            y[i] = (real)(step * floor((double)x[i] / step + 0.5));
    }
}

/* --- Bits ---------------------------------------------------------------- */

/* What an interval of `step` around y costs, and its derivatives by y and by
 * the logarithm (base e) of the step. */
typedef struct { double bits, by_y, by_ln; } cost;

static cost cost_of(double y, double step, double sigma)
{
    const double a = (-fabs(y) - step / 2) / sigma;
    const double b = (-fabs(y) + step / 2) / sigma;
    const double p = fmax(saga_normal_cdf(b) - saga_normal_cdf(a), 1e-30);
    const double pa = saga_normal_pdf(a), pb = saga_normal_pdf(b);
    const double scale = 1 / (p * sigma * M_LN2);

    return (cost){ -log2(p), (y < 0 ? -1 : 1) * (pb - pa) * scale,
                   -(pa + pb) * step / 2 * scale };
}

/* Everything of one tensor. */
static void rate_of(real *dx, saga_weights *w, int t, const real *y,
                    const real *x, double price)
{
    const size_t at = w->tensor[t].at;
    const size_t n = w->tensor[t].rows * w->tensor[t].cols;
    const double step = saga_weights_step(w, t);
    const double sigma = fmax(rms(x, &w->tensor[t]), step / 16);
    double bits = 0, by_ln = 0;
    size_t i;

    for (i = at; i < at + n; i++) {
        const cost k = cost_of((double)y[i], step, sigma);

        bits += k.bits;
        dx[i] += (real)(price * k.by_y);
        by_ln += price * k.by_ln +
                 (double)dx[i] * ((double)y[i] - (double)x[i]);
    }
    w->bits[t] = bits;
    w->d_log2_step[t] = (real)(by_ln * M_LN2);
}

double saga_weights_rate(real *dx, saga_weights *w, const real *y,
                         const real *x, double price)
{
    double bits = 0;
    int t;

#pragma omp parallel for schedule(dynamic)
    for (t = 0; t < w->n; t++)
        rate_of(dx, w, t, y, x, price);
    for (t = 0; t < w->n; t++)
        bits += w->bits[t];
    return bits;
}
