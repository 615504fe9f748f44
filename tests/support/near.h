/* SPDX-License-Identifier: MIT
 *
 * Compares tensors that were computed in two ways, relative to the largest
 * magnitude.
 */
#ifndef NEAR_H
#define NEAR_H

#include "real.h"
#include "testing.h"

#include <math.h>

static inline double largest(const real *x, size_t n)
{
    double most = 0;

    for (size_t i = 0; i < n; i++)
        most = fmax(most, fabs((double)x[i]));
    return most;
}

/* Returns whether each of x is within `part` of the largest magnitude of y. A
 * value that is not finite is not near. */
static inline bool is_near(const char *scene, const char *of, const real *x,
                           const real *y, size_t n, double part)
{
    const double most = largest(y, n);
    double worst = 0;

    for (size_t i = 0; i < n; i++) {
        const double off = fabs((double)x[i] - (double)y[i]);

        worst = fmax(worst, isfinite(off) ? off : INFINITY);
    }
    if (worst <= part * most)
        return true;
    print_error("%s, %s: differs by %g of %g\n", scene, of, worst, most);
    return false;
}

#endif
