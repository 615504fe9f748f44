/* SPDX-License-Identifier: MIT
 *
 * The trainer's real type. Every operator compiles twice: with float for
 * training, with double (-DSAGA_REAL_DOUBLE) for finite differences and as the
 * float64 reference. Both sets of objects may be linked into one program: the
 * symbols of the second end in _f64. A header that declares such a function
 * renames it with
 *
 *     #define saga_thing SAGA_REAL_NAME(saga_thing)
 *
 * One translation unit sees one of the two.
 */
#ifndef SAGA_REAL_H
#define SAGA_REAL_H

#include <float.h>

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

/* R(x) makes a constant of type real; exact for the double build. */
#define R(x) ((real)(x))

/* Returns x, moved into lo..hi. */
static inline real saga_clamp(real x, real lo, real hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* Returns the gradient d of what may have been clamped to lo..hi: it learns
 * towards the inside alone. */
static inline real saga_inward(real d, real x, real lo, real hi)
{
    return (x <= lo && d > 0) || (x >= hi && d < 0) ? 0 : d;
}

#endif
