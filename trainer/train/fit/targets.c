/* SPDX-License-Identifier: MIT
 *
 * Changes the warm-up's primitives to the form from which the fit starts: still
 * ones where nothing moves, and centred in time where they are visible
 * throughout.
 */
#include "targets.h"

#include "base_choice.h"
#include "model.h"
#include "splat_age.h"

#include <math.h>

/* Returns log2(1 + 2^x). */
static double softplus2(double x)
{
    return fmax(x, 0) + log2(1 + exp2(-fabs(x)));
}

/* Returns the opacity parameter after log2 alpha has fallen by `lost`. */
static double dimmed(double opacity, double lost)
{
    /* Alpha is 2^(3 - q) with q = log2(1 + 2^(3 - o)); this solves q + lost for
     * o. From 40 bits on, 2^q - 1 equals 2^q in double. */
    const double q = softplus2(SAGA_PEAK_LOG2 - opacity) + lost;

    return q < 1e-9 ? opacity
                    : SAGA_PEAK_LOG2 - (q < 40 ? log2(exp2(q) - 1) : q);
}

/* Moves the temporal centre of primitive i to the middle of the segment. Its
 * motion and rotation stay the same; its opacity is reduced to what it is
 * there. */
static void centre(saga_splat_params *p, size_t i)
{
    const real dt = R(0.5) - p->t_centre[i];
    const real age = dt * saga_splat_ageing(p, i);

    /* The cubic is expanded about another time: its value there, then orders 1
     * and 2, in this order, because each reads the later coefficients. Order 3
     * stays the same. */
    for (size_t a = 0; p->motion && a < 3; a++) {
        real *const b = p->motion + 9 * i + a;

        p->mean[3 * i + a] += ((b[6] * age + b[3]) * age + b[0]) * age;
        b[0] += (3 * b[6] * age + 2 * b[3]) * age;
        b[3] += 3 * b[6] * age;
    }
    for (size_t a = 0; p->slope && a < 4; a++)
        p->quat[4 * i + a] += p->slope[4 * i + a] * age;
    if (p->log2_width) {
        /* Opacity falls by exp(-u^2), which adds log2(e) u^2 to q; u is limited
         * to 16, as in drawing. */
        const double u = (double)dt * exp2(-(double)p->log2_width[i]);

        p->opacity[i] = (real)dimmed((double)p->opacity[i],
                                     1.4426950408889634 * fmin(u * u, 256));
    }
    p->t_centre[i] = R(0.5);
}

static void drop_time(saga_splat_params *p)
{
    for (int a = 0; a < SAGA_N_ATTRS; a++)
        if (saga_attributes[a].is_temporal)
            p->of[a] = NULL;
}

void saga_targets_freeze(saga_splat_params *p, uint32_t n)
{
    if (p->t_centre)
        for (uint32_t i = 0; i < n; i++)
            centre(p, i);
    drop_time(p);
}

void saga_targets_centre(saga_splat_params *p, uint32_t n)
{
    for (uint32_t i = 0; i < n; i++)
        if (saga_plan_is_long(p, i))
            centre(p, i);
}
