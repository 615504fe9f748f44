/* SPDX-License-Identifier: MIT */
#include "policy.h"

#include <math.h>

#define LEAST_LAMBDA 1e-3

/* The start price is this many times the training price, because features start
 * with a step of 1 or less, where a bit lowers the error more than at high
 * rates. */
#define START_PRICE 4

/* A bit of a weight is priced at this many bits of a residual. The noise that
 * training adds to weights is too small to show what rounding them will cost,
 * so this factor decides the size of their steps. On the built-in scene weights
 * take 5.1 bits with a factor of 0.4, 4.2 with 1.2 and 3.6 with 2.5. */
#define WEIGHT_PRICE 1.5

/* The entropy networks have 16 hidden units from this number of primitives on,
 * and 8 below, where the weights of 8 more cost more than they save. For 4,000
 * primitives, offsets and their network take 5,990 bytes with 8 units, 6,260
 * with 16 and 6,760 with 24 (7,320 with constants and no network). */
enum { WIDE_PAYS = 20000 };

/* A hidden layer of F_geo saves more bits of features than its weights take
 * from this number of primitives on (docs/lab/networks.md). */
enum { DEEP_PAYS = 6000 };

/* The error falls with the number of primitives to the power of -0.43 (1.3 dB
 * for twice as many). */
#define ERROR_POWER 0.43
#define LAMBDA_PART (ERROR_POWER / SAGA_PRIMITIVE_BITS)

double saga_policy_lambda(double mse, double n_pixels, uint32_t n_primitives)
{
    /* dMSE / dn = -0.43 MSE / n, and a primitive takes 75 bits, so a bit spent
     * on more primitives lowers 255^2 MSE by 0.43 / 75 255^2 MSE / n. A bit
     * spent on exactness lowers it by lambda / n_pixels. The two are in balance
     * where they are equal. */
    return LAMBDA_PART * 255 * 255 * mse * n_pixels / n_primitives;
}

double saga_policy_primitives(double lambda, double mse, double n_pixels,
                              uint32_t n_primitives)
{
    const double now = saga_policy_lambda(mse, n_pixels, n_primitives);

    /* With MSE(n) = mse (n / n_primitives)^-0.43, lambda is proportional to
     * n^-1.43. */
    return n_primitives * pow(now / lambda, 1 / (1 + ERROR_POWER));
}

saga_policy saga_policy_of(double lambda, double n_pixels,
                           uint32_t n_primitives)
{
    /* Lambda is for squares of 8-bit levels; the loss has values of 0..1. */
    const double price = fmax(lambda, LEAST_LAMBDA) / (255 * 255 * n_pixels);

    return (saga_policy){
        .lambda = lambda,
        .price = { price, START_PRICE * price, WEIGHT_PRICE * price },
        /* Rounding adds an error proportional to the step's square; a larger
         * step saves bits in proportion to primitives and price. The optimum is
         * proportional to the square root of their product. Above half a
         * support, an offset would carry nothing. */
        .prim_step = fmin(fmax(425 * sqrt(price * n_primitives), 1 / 64.0),
                          0.5),
        /* At a higher price of bits, fewer weights pay for themselves. */
        .width = price < 7e-10  ? 64
                 : price < 3e-9 ? 48
                                : 32,
        .entropy_width = n_primitives < WIDE_PAYS ? 8 : 16,
        .deep_pays = n_primitives >= DEEP_PAYS
    };
}
