/* SPDX-License-Identifier: MIT
 *
 * The fit starts from these: the warm-up's primitives in the order of the
 * hierarchy, and as they stand still where nothing moves.
 */
#include "targets.h"

#include "base_choice.h"
#include "model.h"
#include "splat_animate.h"

#include <math.h>

/* Returns log2(1 + 2^x). */
static double softplus2(double x)
{
    return fmax(x, 0) + log2(1 + exp2(-fabs(x)));
}

/* Returns what stands for an opacity after a loss of `lost` in log2 of it. */
static double dimmed(double opacity, double lost)
{
    /* Alpha is 2^(3 - q) with q = log2(1 + 2^(3 - o)); q + lost is solved for
     * o. From 40 bits on, 2^q - 1 is 2^q in double. */
    const double q = softplus2(SAGA_PEAK_LOG2 - opacity) + lost;

    return q < 1e-9 ? opacity
                    : SAGA_PEAK_LOG2 - (q < 40 ? log2(exp2(q) - 1) : q);
}

/* The centre of primitive i's life becomes the middle of the segment, where it
 * moves and turns as before; its opacity fades from there, the same on the mean
 * over the segment. */
static void centre(saga_splat_params *p, size_t i)
{
    const real dt = R(0.5) - p->t_centre[i];
    const real age = dt * saga_splat_ageing(p, i);

    /* The cubic about another moment: its value there, then orders 1 and 2. In
     * this order, since each reads those after it; order 3 stays. */
    for (size_t a = 0; p->motion && a < 3; a++) {
        real *const b = p->motion + 9 * i + a;

        p->mean[3 * i + a] += ((b[6] * age + b[3]) * age + b[0]) * age;
        b[0] += (3 * b[6] * age + 2 * b[3]) * age;
        b[3] += 3 * b[6] * age;
    }
    for (size_t a = 0; p->slope && a < 4; a++)
        p->quat[4 * i + a] += p->slope[4 * i + a] * age;
    if (p->log2_width) {
        /* Opacity falls by exp(-u^2), log2(e) u^2 in q; u is 16 at most, as
         * when it is drawn. */
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
