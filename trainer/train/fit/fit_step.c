/* SPDX-License-Identifier: MIT
 *
 * The step of the coarse features is the lever on a file's size while it is
 * trained: a value takes a bit less in a step twice as long, at once.
 */
#include "fit_state.h"

#include <math.h>

/* Steps are whole multiples of the features' format, and at least what a model
 * may have. */
enum { LEAST_STEP = 16, MOST_STEP = 4096 };

static void set_step(saga_fit *f, uint32_t step)
{
    f->scene->model.step_q16[SAGA_STEP_FEATURE] = step << 16;
    f->used.model = f->grad.model = f->scene->model;
}

static uint32_t step_of(const saga_fit *f)
{
    return f->scene->model.step_q16[SAGA_STEP_FEATURE] >> 16;
}

/* The entropy network goes on to say what it said of the values: its deviations
 * are in steps, its means in units that follow the step. */
static void keep_parameters(saga_fit *f, double factor, double old_unit)
{
    const saga_model *const m = &f->scene->model;
    const saga_net *const net = &f->scene->net[SAGA_NET_E_COARSE];
    const int last = net->n_layers - 1;
    const size_t in = (size_t)net->dim[last], n = 4u + m->features;
    const real units = R(old_unit / (double)saga_rate_mu_unit(
        m, SAGA_KIND_COARSE, 4));

    /* Rows 0..n-1 give mu, rows n..2n-1 log2 sigma; channels 0..3 are the
     * centre, whose step stays. */
    for (size_t c = 4; c < n; c++) {
        /* sigma / step goes down by log2 of the factor, mu stays the same
         * value. */
        net->b[last][n + c] -= R(log2(factor));
        net->b[last][c] *= units;
        for (size_t i = 0; i < in; i++)
            net->w[last][c * in + i] *= units;
    }
}

void saga_fit_scale_step(saga_fit *f, double factor)
{
    const double unit = (double)saga_rate_mu_unit(&f->scene->model,
                                                  SAGA_KIND_COARSE, 4);
    const double old = step_of(f);

    /* Whole LSB of the format; `factor` becomes what could be said. */
    set_step(f, (uint32_t)fmin(fmax(rint(old * factor), LEAST_STEP),
                               MOST_STEP));
    factor = step_of(f) / old;
    keep_parameters(f, factor, unit);
    /* Rounding costs step^2 / 12 and a bit more halves the step, so that a bit
     * gains 2 ln 2 step^2 / 12: its price goes with the square. */
    f->o.price.residual *= factor * factor;
    f->o.price.weight *= factor * factor;
}

double saga_fit_price(const saga_fit *f)
{
    return f->o.price.residual;
}

void saga_fit_walk_step(saga_fit *f, saga_checkpoint *c)
{
    uint64_t step = step_of(f);

    saga_checkpoint_walk(c, &step, sizeof step);
    saga_checkpoint_walk(c, &f->o.price, sizeof f->o.price);
    c->failed = c->failed || step < LEAST_STEP || step > MOST_STEP;
    if (!c->failed)
        set_step(f, (uint32_t)step);
}
