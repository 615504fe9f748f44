/* SPDX-License-Identifier: MIT
 *
 * The compiler makes vectors of 64-bit products where the machine has them, for
 * which this file includes vec.h.
 */
#include "noise.h"

#include "vec.h"

void saga_noise_add(real *to, const real *x, double step, saga_rng r,
                    saga_range of)
{
    for (size_t i = of.begin; i < of.end; i++)
        to[i] = (real)((double)x[i] + step * (saga_rng_double(r, i) - 0.5));
}

SAGA_ISA_CHOOSE(saga_noise_add);
