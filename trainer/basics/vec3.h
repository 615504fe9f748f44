/* SPDX-License-Identifier: MIT
 *
 * Vectors of three doubles.
 */
#ifndef SAGA_VEC3_H
#define SAGA_VEC3_H

#include <math.h>
#include <stdbool.h>

static inline double dot3(const double a[3], const double b[3])
{
    return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

static inline double length3(const double a[3])
{
    return sqrt(dot3(a, a));
}

static inline double distance3(const double a[3], const double b[3])
{
    const double d[3] = { a[0] - b[0], a[1] - b[1], a[2] - b[2] };

    return length3(d);
}

/* Scales a to length 1. Returns false, and leaves a as it is, if it has hardly
 * any length or none that is finite. */
static inline bool normalise3(double a[3])
{
    const double n = length3(a);

    if (!(n > 1e-9 && n < INFINITY))
        return false;
    for (int i = 0; i < 3; i++)
        a[i] /= n;
    return true;
}

/* Sets c, which overlaps neither a nor b, to a x b. */
static inline void cross3(double c[3], const double a[3], const double b[3])
{
    c[0] = a[1] * b[2] - a[2] * b[1];
    c[1] = a[2] * b[0] - a[0] * b[2];
    c[2] = a[0] * b[1] - a[1] * b[0];
}

#endif
