/* SPDX-License-Identifier: MIT */
#include "policy.h"

#include <math.h>

#define LEAST_LAMBDA 1e-3

/* The price of bits where the fit starts, over that in training: features are
 * coded in a step or less, where a bit buys more than at high rates. */
#define START_PRICE 4

/* A weight's bit costs this many of a residual's: its noise is so small that it
 * says little of what rounding will cost, so this sets the size of steps. The
 * built-in scene's weights take 5.1 bits at 0.4, 4.2 at 1.2, 3.6 at 2.5. */
#define WEIGHT_PRICE 1.5

/* 16 hidden units gain more over 8 the more primitives there are, and pay for
 * their weights from about this number on. Offsets of 4,000 primitives and
 * their network take 5,990 bytes with 8, 6,260 with 16, 6,760 with 24
 * (constants: 7,320). */
enum { WIDE_PAYS = 20000 };

/* A memory bank may be worth its networks from this number of primitives on: of
 * 15,000 it saves a third of them (docs/lab/memory.md). */
enum { BANK_PAYS = 40000 };

/* Hidden units of F_geo save more features than they take weights from this
 * number of primitives on (docs/lab/networks.md). */
enum { DEEP_PAYS = 6000 };

/* The error falls with the number of primitives to the power of -0.43 (1.3 dB
 * for twice as many). */
#define ERROR_POWER 0.43
#define LAMBDA_PART (ERROR_POWER / SAGA_PRIMITIVE_BITS)

double saga_policy_lambda(double mse, double n_pixels, uint32_t n_primitives)
{
    /* dMSE / dn = -0.43 MSE / n, and a primitive takes 75 bits: a bit more in
     * primitives lowers 255^2 MSE by 0.43 / 75 255^2 MSE / n. A bit more of
     * exactness lowers it by lambda / n_pixels; in balance both are equal. */
    return LAMBDA_PART * 255 * 255 * mse * n_pixels / n_primitives;
}

double saga_policy_primitives(double lambda, double mse, double n_pixels,
                              uint32_t n_primitives)
{
    const double now = saga_policy_lambda(mse, n_pixels, n_primitives);

    /* With MSE(n) = mse (n / n_primitives)^-0.43, lambda goes with n^-1.43. */
    return n_primitives * pow(now / lambda, 1 / (1 + ERROR_POWER));
}

saga_policy saga_policy_of(double lambda, double n_pixels,
                           uint32_t n_primitives)
{
    /* From squares of 8-bit levels to those of 0..1, which the loss has. */
    const double price = fmax(lambda, LEAST_LAMBDA) / (255 * 255 * n_pixels);

    return (saga_policy){
        .price = { price, START_PRICE * price, WEIGHT_PRICE * price },
        /* Rounding costs the pictures by the square of the step, and saves by
         * the primitives and the price of their bits; half a support says all
         * that the lowest rates want to know. */
        .prim_step = fmin(fmax(425 * sqrt(price * n_primitives), 1 / 64.0),
                          0.5),
        /* The dearer bits are, the fewer weights are worth theirs. */
        .width = price < 7e-10 ? 64 : price < 3e-9 ? 48 : 32,
        .entropy_width = n_primitives < WIDE_PAYS ? 8 : 16,
        .bank_pays = n_primitives >= BANK_PAYS,
        .deep_pays = n_primitives >= DEEP_PAYS
    };
}
