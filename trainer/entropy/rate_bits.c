/* SPDX-License-Identifier: MIT */
#include "rate_bits.h"

#include "normal.h"

#include <math.h>

#define LN2 0.69314718055994530942

saga_rate_cost saga_rate_bits(double v, double log2_sigma)
{
    const double per_sigma = exp2(-log2_sigma);
    /* By symmetry, |v| is used, where the tails are precise. */
    const double near = (fabs(v) - 0.5) * per_sigma;
    const double far = (fabs(v) + 0.5) * per_sigma;
    const double at_near = saga_normal_pdf(near);
    const double at_far = saga_normal_pdf(far);
    const double p = saga_normal_cdf(-near) - saga_normal_cdf(-far);
    const double spread = 1 + v * v / 64;
    const double escape = exp2(-21) / spread;
    const double sum = p + escape;
    /* For v > 0, dp / dv is the density at far minus that at near, over
     * sigma. */
    const double slope = (at_far - at_near) * per_sigma;
    const double d_p = v < 0 ? -slope : slope;
    saga_rate_cost cost;

    cost.bits = -log2(sum);
    cost.d_v = (escape * (v / 32) / spread - d_p) / (sum * LN2);
    /* The derivatives of near and far by log2 sigma are -ln 2 times themselves.
     * This ln 2 cancels against that of the logarithm. */
    cost.d_log2_sigma = (far * at_far - near * at_near) / sum;
    return cost;
}
