/* SPDX-License-Identifier: MIT
 *
 * Vectors of reals, by the GNU vector extension: 32 bytes where AVX2 is
 * compiled in (isa.h), otherwise 16 (gcc 12 compiles longer ones badly).
 * Results depend only on the vector length and on whether there is fused
 * multiply-add: the sources say which products are fused, and -ffp-contract=off
 * stops the compiler from fusing others.
 */
#ifndef SAGA_VEC_H
#define SAGA_VEC_H

#include "real.h"

#include <stdint.h>
#include <string.h>
#include <tgmath.h>

#ifdef __AVX2__
#include <immintrin.h>
#define VEC_NBYTES 32
#else
#define VEC_NBYTES 16
#endif

#ifdef SAGA_REAL_DOUBLE
typedef int64_t real_bits;
typedef uint64_t real_ubits;
#define VEC_LANES (VEC_NBYTES / 8)
#else
typedef int32_t real_bits;
typedef uint32_t real_ubits;
#define VEC_LANES (VEC_NBYTES / 4)
#endif

typedef real vec __attribute__((vector_size(VEC_NBYTES)));
typedef real_bits veci __attribute__((vector_size(VEC_NBYTES)));
typedef real_ubits vecu __attribute__((vector_size(VEC_NBYTES)));

static inline vec vec_load(const real *p)
{
    vec v;

    memcpy(&v, p, sizeof v);
    return v;
}

static inline void vec_store(real *p, vec v)
{
    memcpy(p, &v, sizeof v);
}

static inline vec vec_set1(real x)
{
    return x - (vec){ 0 };
}

static inline vec vec_zero(void)
{
    return (vec){ 0 };
}

/* Returns 0, 1, 2, ... */
static inline vec vec_iota(void)
{
    vec v = { 0 };
    int i;

    for (i = 0; i < VEC_LANES; i++)
        v[i] = (real)i;
    return v;
}

/* Returns a b + c, with one rounding if the target has fused multiply-add,
 * otherwise two. */
static inline vec vec_fma(vec a, vec b, vec c)
{
#if defined __FMA__ && defined __AVX2__ && defined SAGA_REAL_DOUBLE
    return (vec)_mm256_fmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#elif defined __FMA__ && defined __AVX2__
    return (vec)_mm256_fmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
    return a * b + c;
#endif
}

/* Returns c - a b. */
static inline vec vec_fnma(vec a, vec b, vec c)
{
#if defined __FMA__ && defined __AVX2__ && defined SAGA_REAL_DOUBLE
    return (vec)_mm256_fnmadd_pd((__m256d)a, (__m256d)b, (__m256d)c);
#elif defined __FMA__ && defined __AVX2__
    return (vec)_mm256_fnmadd_ps((__m256)a, (__m256)b, (__m256)c);
#else
    return c - a * b;
#endif
}

/* Returns a in the lanes where mask is all ones, 0 in the others. */
static inline vec vec_and(veci mask, vec a)
{
    return (vec)(mask & (veci)a);
}

static inline vec vec_select(veci mask, vec a, vec b)
{
    return (vec)((mask & (veci)a) | (~mask & (veci)b));
}

/* If either operand is NaN, min and max return the second one, as the
 * instruction does. */
static inline vec vec_min(vec a, vec b)
{
#if defined __AVX2__ && defined SAGA_REAL_DOUBLE
    return (vec)_mm256_min_pd((__m256d)a, (__m256d)b);
#elif defined __AVX2__
    return (vec)_mm256_min_ps((__m256)a, (__m256)b);
#else
    return vec_select((veci)(a < b), a, b);
#endif
}

static inline vec vec_max(vec a, vec b)
{
#if defined __AVX2__ && defined SAGA_REAL_DOUBLE
    return (vec)_mm256_max_pd((__m256d)a, (__m256d)b);
#elif defined __AVX2__
    return (vec)_mm256_max_ps((__m256)a, (__m256)b);
#else
    return vec_select((veci)(a > b), a, b);
#endif
}

static inline vec vec_sqrt(vec a)
{
#if defined __AVX2__ && defined SAGA_REAL_DOUBLE
    return (vec)_mm256_sqrt_pd((__m256d)a);
#elif defined __AVX2__
    return (vec)_mm256_sqrt_ps((__m256)a);
#else
    int i;

    for (i = 0; i < VEC_LANES; i++)
        a[i] = sqrt(a[i]);
    return a;
#endif
}

/* Returns |a|. */
static inline vec vec_abs(vec a)
{
    return (vec)((veci)a & ~(veci)vec_set1(R(-0.0)));
}

/* Returns x clamped to lo..hi, and NaN for NaN. */
static inline vec vec_clamp(vec x, vec lo, vec hi)
{
    return vec_max(lo, vec_min(hi, x));
}

/* Tells whether any lane of a comparison is true. */
static inline int vec_any(veci mask)
{
#if defined __AVX2__ && defined SAGA_REAL_DOUBLE
    return _mm256_movemask_pd((__m256d)mask) != 0;
#elif defined __AVX2__
    return _mm256_movemask_ps((__m256)mask) != 0;
#else
    real_bits any = 0;
    int i;

    for (i = 0; i < VEC_LANES; i++)
        any |= mask[i];
    return any != 0;
#endif
}

/* Adds the halves repeatedly, in a fixed order. */
static inline real vec_sum(vec a)
{
    real x[VEC_LANES];
    int n, i;

    vec_store(x, a);
    for (n = VEC_LANES / 2; n > 0; n /= 2)
        for (i = 0; i < n; i++)
            x[i] += x[i + n];
    return x[0];
}

/* Sets out[i] to the sum of v[i] for eight vectors: first neighbours are added,
 * then pairs, then halves, in every build. */
static inline void vec_sum8(real *out, const vec *v)
{
#if defined __AVX2__ && !defined SAGA_REAL_DOUBLE
    const __m256 a = _mm256_hadd_ps(_mm256_hadd_ps((__m256)v[0], (__m256)v[1]),
                                    _mm256_hadd_ps((__m256)v[2], (__m256)v[3]));
    const __m256 b = _mm256_hadd_ps(_mm256_hadd_ps((__m256)v[4], (__m256)v[5]),
                                    _mm256_hadd_ps((__m256)v[6], (__m256)v[7]));

    _mm256_storeu_ps(out, _mm256_permute2f128_ps(a, b, 0x20) +
                              _mm256_permute2f128_ps(a, b, 0x31));
#else
    int i, k, n;

    for (k = 0; k < 8; k++) {
        real x[VEC_LANES];

        vec_store(x, v[k]);
        for (n = VEC_LANES / 2; n > 0; n /= 2)
            for (i = 0; i < n; i++)
                x[i] = x[2 * i] + x[2 * i + 1];
        out[k] = x[0];
    }
#endif
}

/* Sets out[0] and out[1] to the sums of two vectors, in the same order of
 * additions as vec_sum8. */
static inline void vec_sum2(real *out, vec a, vec b)
{
#if defined __AVX2__ && !defined SAGA_REAL_DOUBLE
    const __m256 ab = _mm256_hadd_ps((__m256)a, (__m256)b);
    const __m256 h = _mm256_hadd_ps(ab, ab);
    const __m128 sum = _mm_add_ps(_mm256_castps256_ps128(h),
                                  _mm256_extractf128_ps(h, 1));

    _mm_storel_pi((__m64 *)(void *)out, sum);
#else
    const vec v[8] = { a, b };
    real sums[8];

    vec_sum8(sums, v);
    out[0] = sums[0];
    out[1] = sums[1];
#endif
}

/* Coefficients of 2^-f for |f| <= 1/2, in float. */
#define VEC_EXP2_5 (-0.00133908633646712344f)
#define VEC_EXP2_4 0.00967603191832205408f
#define VEC_EXP2_3 (-0.0555035711421907782f)
#define VEC_EXP2_2 0.240221074853083375f
#define VEC_EXP2_1 (-0.693147188026228781f)
#define VEC_EXP2_0 1.00000007545489719f

/* Returns 2^-x for x in [-100, 100], with a relative error below 2e-7 (double:
 * 4e-16). Outside that range the result is undefined, but nothing traps. The
 * nearest integer is read from the bits of x + 1.5 * 2^(mantissa bits). The
 * polynomials are Chebyshev fits on [-1/2, 1/2], with errors 7.9e-8 and
 * 3.2e-18. */
static inline vec vec_exp2_neg(vec x)
{
#ifdef SAGA_REAL_DOUBLE
    const vec magic = vec_set1(0x1.8p52);
    const vec i = x + magic;
    const vec f = x - (i - magic);
    vec p = vec_set1(-4.45581790833606449e-10);

    p = vec_fma(p, f, vec_set1(7.07419429728852101e-9));
    p = vec_fma(p, f, vec_set1(-1.01780570877339411e-7));
    p = vec_fma(p, f, vec_set1(1.32154325359123762e-6));
    p = vec_fma(p, f, vec_set1(-0.0000152527338415567726));
    p = vec_fma(p, f, vec_set1(0.000154035304637243542));
    p = vec_fma(p, f, vec_set1(-0.00133335581464064707));
    p = vec_fma(p, f, vec_set1(0.00961812910758725667));
    p = vec_fma(p, f, vec_set1(-0.055504108664821627));
    p = vec_fma(p, f, vec_set1(0.240226506959101596));
    p = vec_fma(p, f, vec_set1(-0.693147180559945309));
    p = vec_fma(p, f, vec_set1(0.999999999999999997));
    return (vec)((vecu)p - ((vecu)i << 52));
#else
    const vec magic = vec_set1(0x1.8p23f);
    const vec i = x + magic;
    const vec f = x - (i - magic);
    vec p = vec_set1(VEC_EXP2_5);

    p = vec_fma(p, f, vec_set1(VEC_EXP2_4));
    p = vec_fma(p, f, vec_set1(VEC_EXP2_3));
    p = vec_fma(p, f, vec_set1(VEC_EXP2_2));
    p = vec_fma(p, f, vec_set1(VEC_EXP2_1));
    p = vec_fma(p, f, vec_set1(VEC_EXP2_0));
    return (vec)((vecu)p - ((vecu)i << 23));
#endif
}

/* Returns 2^x, of x clamped to -100..100; NaN for NaN. */
static inline vec vec_exp2(vec x)
{
    const vec limited = vec_clamp(x, vec_set1(-100), vec_set1(100));

    /* The difference is 0, or NaN. */
    return vec_exp2_neg(-limited) + (limited - limited);
}

#endif
