/* SPDX-License-Identifier: MIT
 *
 * The float twin of the residual coder: the cost of a residual under the
 * distribution with which common/prob.c codes it, as a smooth function. Paper:
 * Rate-Distortion Optimization, the rate term.
 *
 *     bits(v) = -log2(p(v) + 2^-e(v)),
 *     p(v) = P(v - 1/2 < X < v + 1/2), X normal of mean 0 and deviation sigma
 *     e(v) = 21 + log2(1 + v^2 / 64)
 *
 * in steps: v = (y - mu) / step. The coder has 64 such normal distributions,
 * rounded to 2^-15. e bounds the cost of an escape from above: 15 bits
 * (frequency 1), the sign, and the Exp-Golomb code of order 3, whose 4 + 2k
 * bits for 8 (2^k - 1) <= x < 8 (2^(k + 1) - 1) are at most 4 + 2
 * log2(1 + x / 8) <= 5 + log2(1 + x^2 / 64).
 */
#ifndef SAGA_RATE_BITS_H
#define SAGA_RATE_BITS_H

/* log2 sigma of the coder's first and last scale. */
#define SAGA_RATE_LOG2_MIN (-22.0 / 7.0)
#define SAGA_RATE_LOG2_MAX (41.0 / 7.0)

typedef struct saga_rate_cost {
    double bits;
    double d_v, d_log2_sigma; /* its derivatives */
} saga_rate_cost;

/* Returns the cost and its derivatives for any finite v and for log2_sigma
 * within the range above. */
saga_rate_cost saga_rate_bits(double v, double log2_sigma);

#endif
