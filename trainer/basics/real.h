/* SPDX-License-Identifier: MIT
 *
 * The real type of the trainer. Every operator compiles twice: with float for
 * training, and with double (-DSAGA_REAL_DOUBLE) for finite differences and as
 * a float64 reference. A program may link both; the names of the second end in
 * _f64. A header that declares such a function renames it by
 *
 *     #define saga_thing SAGA_REAL_NAME(saga_thing)
 *
 * A translation unit uses only one of the two.
 */
#ifndef SAGA_REAL_H
#define SAGA_REAL_H

#include <float.h>
#include <stddef.h>
#include <string.h>

#ifdef SAGA_REAL_DOUBLE
typedef double real;
#define SAGA_REAL_NAME(name) name##_f64
#define REAL_EPSILON DBL_EPSILON
#define REAL_MAX DBL_MAX
#define REAL_MIN DBL_MIN
#else
typedef float real;
#define SAGA_REAL_NAME(name) name
#define REAL_EPSILON FLT_EPSILON
#define REAL_MAX FLT_MAX
#define REAL_MIN FLT_MIN
#endif

/* R(x) is a constant of type real, exact in double. */
#define R(x) ((real)(x))

/* Returns x clamped to lo..hi. */
static inline real saga_clamp(real x, real lo, real hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* Copies a row of n reals, so few that a call of memcpy would take longer than
 * the copy. Rows must not overlap. */
static inline void saga_copy_row(real *to, const real *from, size_t n)
{
    size_t i;

    for (i = 0; i + 4 <= n; i += 4)
        memcpy(to + i, from + i, 4 * sizeof *to);
    for (; i < n; i++)
        to[i] = from[i];
}

/* Adds a row of n reals to another one, which must not overlap. Four are loaded
 * before they are stored, so that the compiler can use a vector. */
static inline void saga_add_row(real *to, const real *from, size_t n)
{
    size_t i, k;

    for (i = 0; i + 4 <= n; i += 4) {
        real sum[4];

        for (k = 0; k < 4; k++)
            sum[k] = to[i + k] + from[i + k];
        memcpy(to + i, sum, sizeof sum);
    }
    for (; i < n; i++)
        to[i] += from[i];
}

/* Returns the gradient d of a value x that is clamped to lo..hi, or 0 if a step
 * down the gradient would lead further outside. */
static inline real saga_inward(real d, real x, real lo, real hi)
{
    /* Without branches, which nobody could predict from the signs of
     * gradients. */
    return ((x <= lo) & (d > 0)) | ((x >= hi) & (d < 0)) ? 0 : d;
}

#endif
