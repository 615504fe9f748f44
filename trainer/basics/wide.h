/* SPDX-License-Identifier: MIT
 *
 * A wide has sixteen reals, in several vectors (vec.h), or in one register
 * where AVX-512 is compiled in. Every build keeps sixteen separate sums and
 * adds them in the same order, so that AVX-512 gives the same bits as AVX2.
 */
#ifndef SAGA_WIDE_H
#define SAGA_WIDE_H

#include "vec.h"

enum { WIDE_LANES = 16 };

/* Unrolls the short loop after it, so that its values stay in registers. */
#define WIDE_UNROLL _Pragma("GCC unroll 8")

#if defined __AVX512F__ && defined __FMA__ && !defined SAGA_REAL_DOUBLE

typedef __m512 wide;
typedef __mmask16 wide_mask;

static inline wide wide_load(const real *p)
{
    return _mm512_loadu_ps(p);
}
static inline void wide_store(real *p, wide a)
{
    _mm512_storeu_ps(p, a);
}
static inline wide wide_set1(real x)
{
    return _mm512_set1_ps(x);
}
static inline wide wide_add(wide a, wide b)
{
    return _mm512_add_ps(a, b);
}
static inline wide wide_sub(wide a, wide b)
{
    return _mm512_sub_ps(a, b);
}
static inline wide wide_mul(wide a, wide b)
{
    return _mm512_mul_ps(a, b);
}
static inline wide wide_div(wide a, wide b)
{
    return _mm512_div_ps(a, b);
}
static inline wide wide_sqrt(wide a)
{
    return _mm512_sqrt_ps(a);
}
static inline wide wide_min(wide a, wide b)
{
    return _mm512_min_ps(a, b);
}
static inline wide wide_max(wide a, wide b)
{
    return _mm512_max_ps(a, b);
}

/* Returns a b + c. */
static inline wide wide_fma(wide a, wide b, wide c)
{
    return _mm512_fmadd_ps(a, b, c);
}

/* Returns c - a b. */
static inline wide wide_fnma(wide a, wide b, wide c)
{
    return _mm512_fnmadd_ps(a, b, c);
}

static inline wide_mask wide_less(wide a, wide b)
{
    return _mm512_cmp_ps_mask(a, b, _CMP_LT_OQ);
}

static inline wide_mask wide_at_least(wide a, wide b)
{
    return _mm512_cmp_ps_mask(a, b, _CMP_GE_OQ);
}

static inline wide_mask wide_both(wide_mask a, wide_mask b)
{
    return (wide_mask)(a & b);
}

/* Returns a in the lanes where the mask is set, 0 in the others. */
static inline wide wide_keep(wide_mask mask, wide a)
{
    return _mm512_maskz_mov_ps(mask, a);
}

/* Returns a in the lanes where the mask is set, b in the others. */
static inline wide wide_select(wide_mask mask, wide a, wide b)
{
    return _mm512_mask_blend_ps(mask, b, a);
}

static inline int wide_any(wide_mask mask)
{
    return mask != 0;
}

/* Returns 2^-x, as vec_exp2_neg. */
static inline wide wide_exp2_neg(wide x)
{
    const wide magic = wide_set1(0x1.8p23f);
    const wide i = wide_add(x, magic);
    const wide f = wide_sub(x, wide_sub(i, magic));
    wide p = wide_set1(VEC_EXP2_5);

    p = wide_fma(p, f, wide_set1(VEC_EXP2_4));
    p = wide_fma(p, f, wide_set1(VEC_EXP2_3));
    p = wide_fma(p, f, wide_set1(VEC_EXP2_2));
    p = wide_fma(p, f, wide_set1(VEC_EXP2_1));
    p = wide_fma(p, f, wide_set1(VEC_EXP2_0));
    return _mm512_castsi512_ps(_mm512_sub_epi32(
        _mm512_castps_si512(p), _mm512_slli_epi32(_mm512_castps_si512(i), 23)));
}

/* Returns the lower eight lanes plus the upper eight. */
static inline vec wide_fold(wide a)
{
    return (vec)_mm256_add_ps(
        _mm512_castps512_ps256(a),
        _mm256_castpd_ps(_mm512_extractf64x4_pd(_mm512_castps_pd(a), 1)));
}

#else

enum { WIDE_VECS = WIDE_LANES / VEC_LANES };

typedef struct wide {
    vec v[WIDE_VECS];
} wide;
typedef struct wide_mask {
    veci v[WIDE_VECS];
} wide_mask;

static inline wide wide_load(const real *p)
{
    wide a;
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_load(p + i * VEC_LANES);
    return a;
}

static inline void wide_store(real *p, wide a)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        vec_store(p + i * VEC_LANES, a.v[i]);
}

static inline wide wide_set1(real x)
{
    wide a;
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_set1(x);
    return a;
}

static inline wide wide_add(wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] += b.v[i];
    return a;
}

static inline wide wide_sub(wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] -= b.v[i];
    return a;
}

static inline wide wide_mul(wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] *= b.v[i];
    return a;
}

static inline wide wide_div(wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] /= b.v[i];
    return a;
}

static inline wide wide_sqrt(wide a)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_sqrt(a.v[i]);
    return a;
}

static inline wide wide_min(wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_min(a.v[i], b.v[i]);
    return a;
}

static inline wide wide_max(wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_max(a.v[i], b.v[i]);
    return a;
}

/* Returns a b + c. */
static inline wide wide_fma(wide a, wide b, wide c)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        c.v[i] = vec_fma(a.v[i], b.v[i], c.v[i]);
    return c;
}

/* Returns c - a b. */
static inline wide wide_fnma(wide a, wide b, wide c)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        c.v[i] = vec_fnma(a.v[i], b.v[i], c.v[i]);
    return c;
}

static inline wide_mask wide_less(wide a, wide b)
{
    wide_mask m;
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        m.v[i] = (veci)(a.v[i] < b.v[i]);
    return m;
}

static inline wide_mask wide_at_least(wide a, wide b)
{
    wide_mask m;
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        m.v[i] = (veci)(a.v[i] >= b.v[i]);
    return m;
}

static inline wide_mask wide_both(wide_mask a, wide_mask b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] &= b.v[i];
    return a;
}

/* Returns a in the lanes where the mask is set, 0 in the others. */
static inline wide wide_keep(wide_mask mask, wide a)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_and(mask.v[i], a.v[i]);
    return a;
}

/* Returns a in the lanes where the mask is set, b in the others. */
static inline wide wide_select(wide_mask mask, wide a, wide b)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        a.v[i] = vec_select(mask.v[i], a.v[i], b.v[i]);
    return a;
}

static inline int wide_any(wide_mask mask)
{
    veci any = mask.v[0];
    int i;

    WIDE_UNROLL
    for (i = 1; i < WIDE_VECS; i++)
        any |= mask.v[i];
    return vec_any(any);
}

/* Returns 2^-x, as vec_exp2_neg. */
static inline wide wide_exp2_neg(wide x)
{
    int i;

    WIDE_UNROLL
    for (i = 0; i < WIDE_VECS; i++)
        x.v[i] = vec_exp2_neg(x.v[i]);
    return x;
}

/* Returns one vector of sums: the lanes of all vectors, added by halves. */
static inline vec wide_fold(wide a)
{
    int n, i;

    for (n = WIDE_VECS / 2; n > 0; n /= 2)
        for (i = 0; i < n; i++)
            a.v[i] += a.v[i + n];
    return a.v[0];
}

#endif

static inline wide wide_zero(void)
{
    return wide_set1(0);
}

#endif
