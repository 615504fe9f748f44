/* SPDX-License-Identifier: MIT */
#include "policy.h"

#include <math.h>

#define LEAST_LAMBDA 1e-3

/* What bits are worth where the fit starts, of what they are in training:
 * features are coded in a step or less, where a bit buys more than at high
 * rates. */
#define START_PRICE 4

/* A weight's bit costs that many residual's: its noise is so small that it says
 * little of what rounding will cost, so this sets the size of steps. The
 * built-in scene's weights take 5.1 bits at 0.4, 4.2 at 1.2, 3.6 at 2.5. */
#define WEIGHT_PRICE 1.5

/* Of 4,000 primitives' offsets and their network 8 hidden units make 5,990
 * bytes, 16 6,260, 24 6,760 (constants: 7,320); what 16 gain over 8 grows with
 * the primitives and pays for their weights from about here on. */
enum { WIDE_PAYS = 20000 };

/* From so many primitives on a memory bank may be worth its networks: of 15,000
 * it saves a third of them (docs/lab/memory.md). */
enum { BANK_PAYS = 40000 };

/* Of so many primitives hidden units of F_geo save more features than they take
 * weights (docs/lab/networks.md). */
enum { DEEP_PAYS = 6000 };

/* The error falls with the number of primitives to the power of -0.43 (1.3 dB
 * for twice as many). */
#define ERROR_POWER 0.43
#define LAMBDA_PART (ERROR_POWER / SAGA_PRIMITIVE_BITS)

double saga_policy_lambda(double mse, double n_pixels, uint32_t n_primitives)
{
    return LAMBDA_PART * 255 * 255 * mse * n_pixels / n_primitives;
}

double saga_policy_primitives(double lambda, double mse, double n_pixels,
                              uint32_t n_primitives)
{
    const double now = saga_policy_lambda(mse, n_pixels, n_primitives);

    return n_primitives * pow(now / lambda, 1 / (1 + ERROR_POWER));
}

saga_policy saga_policy_of(double lambda, double n_pixels,
                           uint32_t n_primitives)
{
    const double price = fmax(lambda, LEAST_LAMBDA) / (255 * 255 * n_pixels);

    return (saga_policy){
        .price = { price, START_PRICE * price, WEIGHT_PRICE * price },
        /* What rounding costs in the pictures grows with the square of the
         * step, what it saves with the primitives and the price of their bits;
         * half a support says all that the lowest rates want to know. */
        .prim_step = fmin(fmax(425 * sqrt(price * n_primitives), 1 / 64.0),
                          0.5),
        /* The dearer bits are, the fewer weights are worth theirs. */
        .width = price < 7e-10 ? 64 : price < 3e-9 ? 48 : 32,
        .entropy_width = n_primitives < WIDE_PAYS ? 8 : 16,
        .bank_pays = n_primitives >= BANK_PAYS,
        .deep_pays = n_primitives >= DEEP_PAYS
    };
}
