/* SPDX-License-Identifier: MIT
 *
 * The step of the coarse features controls the size of a file during training:
 * doubling it saves about one bit for each value at once.
 */
#include "fit_state.h"

#include <math.h>

/* Steps are whole units of the features' format, at least the least that a
 * model may have. */
enum { LEAST_STEP = 16, MOST_STEP = 4096 };

double saga_fit_feature_step(const saga_scene *s)
{
    return ldexp(s->model.step_q16[SAGA_STEP_FEATURE] / 65536.0,
                 -s->model.out_q[SAGA_OUT_COARSE]);
}

static void set_step(saga_fit *f, uint32_t step)
{
    f->scene->model.step_q16[SAGA_STEP_FEATURE] = step << 16;
    f->used.model = f->grad.model = f->scene->model;
}

static uint32_t step_of(const saga_fit *f)
{
    return f->scene->model.step_q16[SAGA_STEP_FEATURE] >> 16;
}

/* Changes the last layer of the entropy network so that it predicts the same
 * values with the new step: its deviations are in steps, and its means in units
 * that depend on the step. */
static void keep_parameters(saga_fit *f, double factor, double old_unit)
{
    const saga_model *const m = &f->scene->model;
    const saga_net *const net = &f->scene->net[SAGA_NET_E_COARSE];
    const int last = net->n_layers - 1;
    const size_t in = (size_t)net->dim[last], n = 4u + m->features;
    const real units = R(old_unit /
                         (double)saga_rate_mu_unit(m, SAGA_KIND_COARSE, 4));

    /* Rows 0..n-1 give mu, rows n..2n-1 log2 sigma. Channels 0..3 are the
     * centre, whose step stays the same. */
    for (size_t c = 4; c < n; c++) {
        /* log2(sigma / step) falls by log2 of the factor, and mu keeps its
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

    /* The step becomes a whole number of units, and `factor` the actual
     * ratio. */
    set_step(f,
             (uint32_t)fmin(fmax(rint(old * factor), LEAST_STEP), MOST_STEP));
    factor = step_of(f) / old;
    keep_parameters(f, factor, unit);
    /* Rounding costs step^2 / 12, and one bit more halves the step. A bit is
     * thus worth 2 ln 2 step^2 / 12, proportional to the square of the step. */
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
