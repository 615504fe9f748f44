/* SPDX-License-Identifier: MIT
 *
 * The normal distribution with mean 0 and deviation 1. The cdf is precise far
 * below 0 too, so P(X > x) should be computed as cdf(-x).
 */
#ifndef SAGA_NORMAL_H
#define SAGA_NORMAL_H

#include <math.h>

static inline double saga_normal_cdf(double x)
{
    return 0.5 * erfc(-x * 0.70710678118654752440);
}

static inline double saga_normal_pdf(double x)
{
    return 0.39894228040143267794 * exp(-0.5 * x * x);
}

#endif
