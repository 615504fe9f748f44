/* SPDX-License-Identifier: MIT */
#include "weight_rate.h"

#include "normal.h"
#include "prob.h"
#include "quantise.h"
#include "rng.h"
#include "scene.h"
#include "threads.h"

#include <math.h>
#include <string.h>

/* --- Tensors and steps --------------------------------------------------- */

static void add_tensor(saga_weights *w, saga_weight_tensor t)
{
    w->tensor[w->n++] = t;
}

void saga_weights_list(saga_weights *w, const saga_net net[SAGA_N_NETS],
                       const uint8_t int8[SAGA_N_NETS], const real *params)
{
    int i, k;

    memset(w, 0, sizeof *w);
    for (i = 0; i < SAGA_N_NETS; i++)
        for (k = 0; !saga_is_entropy_net(i) && k < net[i].n_layers &&
                    net[i].dim[0] > 0;
             k++) {
            const size_t rows = (size_t)net[i].dim[k + 1];

            add_tensor(w, (saga_weight_tensor){
                              i, k, (size_t)(net[i].w[k] - params), rows,
                              (size_t)net[i].dim[k], int8[i], false });
            add_tensor(w, (saga_weight_tensor){ i, k,
                                                (size_t)(net[i].b[k] - params),
                                                rows, 1, int8[i], false });
        }
}

void saga_weights_fix(saga_weights *w, int net)
{
    const int t = saga_weights_find(w, net, 0);

    w->tensor[t].fixed = w->tensor[t + 1].fixed = true;
}

/* The deviations of a tensor's rows or columns, or the one of all of it. */
typedef struct {
    int mode;     /* SAGA_SCALE_* */
    size_t lines; /* number of deviations */
    double sigma[SAGA_MAX_VECTOR];
} deviations;

/* Returns the index of the deviation for parameter i of a tensor. */
static size_t line_of(int mode, size_t i, size_t cols)
{
    return mode == SAGA_SCALE_ROW      ? i / cols
           : mode == SAGA_SCALE_COLUMN ? i % cols
                                       : 0;
}

/* Measures the deviations of a tensor, each at least `least`. */
static void measure(deviations *d, int mode, const real *x,
                    const saga_weight_tensor *t, double least)
{
    const uint32_t lines = saga_scale_lines((uint32_t)mode, (uint32_t)t->cols,
                                            (uint32_t)t->rows);
    const size_t n = t->rows * t->cols;
    size_t i;

    d->mode = mode;
    d->lines = lines ? lines : 1;
    memset(d->sigma, 0, d->lines * sizeof *d->sigma);
    for (i = 0; i < n; i++)
        d->sigma[line_of(mode, i, t->cols)] += (double)x[t->at + i] *
                                               (double)x[t->at + i];
    for (i = 0; i < d->lines; i++)
        d->sigma[i] = fmax(sqrt(d->sigma[i] * (double)d->lines / (double)n),
                           least);
}

/* The biases of a layer follow its weights. */
static bool is_bias(int tensor)
{
    return tensor % 2 == 1;
}

void saga_weights_start(saga_weights *w, const real *params)
{
    deviations d;
    int t;

    for (t = 0; t < w->n; t++) {
        measure(&d, SAGA_SCALE_TENSOR, params, &w->tensor[t], 1e-6);
        w->log2_step[t] = (real)log2(d.sigma[0] / 64);
        if (is_bias(t) && w->log2_step[t] < w->log2_step[t - 1])
            w->log2_step[t] = w->log2_step[t - 1];
        if (w->tensor[t].fixed)
            w->log2_step[t] = is_bias(t) ? -SAGA_FIXED_BIAS : 0;
    }
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

    return exp2(t % 2 || w->tensor[t].int8 ? floor(x + 0.5) : x);
}

/* Nanoseconds for the noise of a parameter. */
enum { NOISE_NS = 5 };

/* The inputs that all tensors share. */
typedef struct {
    real *y;
    const real *x;
    const saga_weights *w;
    int n_rounded;
    double noise;
    uint64_t seed;
} noising;

static void tensor_noise(void *user, size_t t)
{
    const noising *const j = user;
    const size_t at = j->w->tensor[t].at;
    const size_t n = j->w->tensor[t].rows * j->w->tensor[t].cols;
    const saga_rng r = saga_rng_stream(j->seed, (uint64_t)t);
    const double size = (int)t < j->n_rounded || j->w->tensor[t].fixed
                            ? 0
                            : j->noise * saga_weights_step(j->w, (int)t);
    size_t i;

    for (i = 0; i < n; i++)
        j->y[at + i] = (real)((double)j->x[at + i] +
                              size * (saga_rng_double(r, i) - 0.5));
}

void saga_weights_noise(real *y, const real *x, const saga_weights *w,
                        int n_rounded, double noise, uint64_t seed)
{
    noising j = { y, x, w, n_rounded, noise, seed };
    saga_tasks all = { .run = tensor_noise, .user = &j, .n = (size_t)w->n };
    int t;

    for (t = 0; t < w->n; t++)
        all.ns += NOISE_NS * (double)(w->tensor[t].rows * w->tensor[t].cols);
    saga_parallel(&all);
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

/* The bits of an interval of `step` around y, with the derivatives by y and by
 * the natural logarithm of the step. */
typedef struct {
    double bits, by_y, by_ln;
} cost;

static cost cost_of(double y, double step, double sigma)
{
    /* p = cdf(b) - cdf(a), on the negative side, where the cdf is precise.
     * 1e-30 limits the bits of a parameter to 100. */
    const double a = (-fabs(y) - step / 2) / sigma;
    const double b = (-fabs(y) + step / 2) / sigma;
    const double p = fmax(saga_normal_cdf(b) - saga_normal_cdf(a), 1e-30);
    const double pa = saga_normal_pdf(a), pb = saga_normal_pdf(b);
    const double scale = 1 / (p * sigma * M_LN2);

    /* If y changes, a and b both change by 1 / sigma times the change of -|y|.
     * If ln step changes, they change by step / 2 / sigma, in opposite
     * directions. */
    return (cost){ -log2(p), (y < 0 ? -1 : 1) * (pb - pa) * scale,
                   -(pa + pb) * step / 2 * scale };
}

/* Returns the approximate bits of n parameters and of the scales of their
 * deviations: log2(sigma / step sqrt(2 pi e)) for each parameter, as for a
 * normal distribution, with a 1 added under the root so that values far below a
 * step take nothing. */
static double about(const deviations *d, size_t n, double step)
{
    const double each = (double)n / (double)d->lines;
    double bits = d->mode == SAGA_SCALE_TENSOR
                      ? 0
                      : (double)SAGA_QUANTISE_LINE_BITS * (double)d->lines;
    size_t i;

    for (i = 0; i < d->lines; i++) {
        const double r = d->sigma[i] / step;

        bits += each * 0.5 * log2(1 + 2 * M_PI * M_E * r * r);
    }
    return bits;
}

/* Chooses the mode that takes the fewest bits; biases have one deviation. No
 * deviation is below the lowest scale of the file. */
static void choose(deviations *d, const real *x, const saga_weight_tensor *t,
                   double step, int is_bias)
{
    const double least = step *
                         exp2(-(double)SAGA_SCALE_UNIT / SAGA_SCALE_PER_OCTAVE);
    const size_t n = t->rows * t->cols;
    int mode;

    measure(d, SAGA_SCALE_TENSOR, x, t, least);
    for (mode = SAGA_SCALE_ROW; !is_bias && mode < SAGA_N_SCALE_MODES; mode++) {
        deviations other;

        measure(&other, mode, x, t, least);
        if (about(&other, n, step) < about(d, n, step))
            *d = other;
    }
}

/* Computes bits and gradients of one tensor. */
static void rate_of(real *dx, saga_weights *w, int t, const real *y,
                    const real *x, double price)
{
    const size_t at = w->tensor[t].at;
    const size_t n = w->tensor[t].rows * w->tensor[t].cols;
    const double step = saga_weights_step(w, t);
    const size_t cols = w->tensor[t].cols;
    double bits = 0, by_ln = 0;
    deviations d;
    size_t i;

    if (w->tensor[t].fixed) {
        memset(dx + at, 0, n * sizeof *dx);
        return;
    }
    choose(&d, x, &w->tensor[t], step, t % 2);
    for (i = at; i < at + n; i++) {
        const cost k = cost_of((double)y[i], step,
                               d.sigma[line_of(d.mode, i - at, cols)]);

        bits += k.bits;
        dx[i] += (real)(price * k.by_y);
        /* The noisy weight is y = x + step * noise, so its derivative with
         * respect to ln(step) is y - x. dx is the gradient of the loss, with
         * the price of bits, with respect to y. */
        by_ln += price * k.by_ln +
                 (double)dx[i] * ((double)y[i] - (double)x[i]);
    }
    w->mode[t] = d.mode;
    w->bits[t] = bits;
    w->d_log2_step[t] = (real)(by_ln * M_LN2);
}

/* Nanoseconds for a parameter. */
enum { PARAM_NS = 50 };

/* The inputs that all tensors share. */
typedef struct {
    real *dx;
    saga_weights *w;
    const real *y, *x;
    double price;
} rating;

static void rate_tensor(void *user, size_t t)
{
    const rating *const r = user;

    rate_of(r->dx, r->w, (int)t, r->y, r->x, r->price);
}

double saga_weights_rate(real *dx, saga_weights *w, const real *y,
                         const real *x, double price)
{
    rating r = { dx, w, y, x, price };
    saga_tasks all = { .run = rate_tensor, .user = &r, .n = (size_t)w->n };
    double bits = 0;
    int t;

    for (t = 0; t < w->n; t++)
        all.ns += PARAM_NS * (double)(w->tensor[t].rows * w->tensor[t].cols);
    saga_parallel(&all);
    for (t = 0; t < w->n; t++)
        bits += w->bits[t];
    return bits;
}
