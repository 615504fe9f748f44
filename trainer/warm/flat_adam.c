/* SPDX-License-Identifier: MIT
 *
 * Adam. Elementwise, so any number of threads gives the same bits.
 */
#include "flat_state.h"

#include <math.h>

#define BETA1 0.9
#define BETA2 0.995
#define EPSILON R(1e-15)

/* step counts from 1. */
void saga_flat_adam(real *value, real *m, real *v, const real *grad, size_t n,
                    real rate, int step)
{
    const real b1 = R(BETA1), b2 = R(BETA2);
    const double c1 = 1 - pow(BETA1, step), c2 = 1 - pow(BETA2, step);
    const real a = (real)(rate / c1), s = (real)(1 / c2);
    int64_t i;

#pragma omp parallel for schedule(static)
    for (i = 0; i < (int64_t)n; i++) {
        m[i] = b1 * m[i] + (1 - b1) * grad[i];
        v[i] = b2 * v[i] + (1 - b2) * (grad[i] * grad[i]);
        value[i] -= a * m[i] / ((real)sqrt(s * v[i]) + EPSILON);
    }
}
