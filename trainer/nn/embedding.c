/* SPDX-License-Identifier: MIT */
#include "embedding.h"

#include "vec.h"

enum { ANGLES = 32 }; /* angles computed at a time */

/* Coefficients of sin and cos of f quarter turns, |f| <= 1/2, in z = f^2:
 * Chebyshev fits with errors 4.9e-9 and 4.8e-11 (double: below 1e-20).
 * x + MAGIC has the integer nearest to x in its low bits. */
#ifdef SAGA_REAL_DOUBLE
#define MAGIC 0x1.8p52
static const real sine_fit[] = {
    1.57079632679489662,     -0.645964097506246252,   0.0796926262461669242,
    -0.00468175413531481935, 0.000160441184726575306, -3.59884271652424977e-6,
    5.69192765495110528e-8,  -6.62760087835982001e-10
};
static const real cosine_fit[] = { 1,
                                   -1.23370055013616983,
                                   0.253669507901048013,
                                   -0.0208634807633529173,
                                   0.000919260274838531306,
                                   -0.0000252020423627167991,
                                   4.71087407669634674e-7,
                                   -6.38632524187481249e-9,
                                   6.5066306128911035e-11 };
#else
#define MAGIC 0x1.8p23f
static const real sine_fit[] = { 1.57079632194550714f, -0.645963476923445733f,
                                 0.0796802077690187509f,
                                 -0.00460211761606189955f };
static const real cosine_fit[] = { 0.999999999952394542f, -1.23370054061799243f,
                                   0.253669203291225125f,
                                   -0.0208600667843804606f,
                                   0.000903621860926019771f };
#endif
enum {
    N_SINE = sizeof sine_fit / sizeof *sine_fit,
    N_COSINE = sizeof cosine_fit / sizeof *cosine_fit
};

static inline vec polynomial(const real *c, int n, vec z)
{
    vec p = vec_set1(c[n - 1]);
    int i;

    for (i = n - 2; i >= 0; i--)
        p = vec_fma(p, z, vec_set1(c[i]));
    return p;
}

/* Returns a, or -a where bit 1 of n is set. */
static inline vec negate_on_bit1(vec a, veci n)
{
    const veci sign = (n & 2) != 0;

    return vec_select(sign, -a, a);
}

/* Sets *sine and *cosine of x quarter turns. */
static inline void turn(vec *sine, vec *cosine, vec x)
{
    const vec shifted = x + vec_set1(MAGIC);
    /* Subtracting the nearest whole number of quarter turns leaves
     * -1/2..1/2. */
    const vec f = x - (shifted - vec_set1(MAGIC));
    const veci n = (veci)shifted;
    const veci odd = (n & 1) != 0;
    const vec s = f * polynomial(sine_fit, N_SINE, f * f);
    const vec c = polynomial(cosine_fit, N_COSINE, f * f);

    /* An odd number of quarter turns exchanges sine and cosine. The sine is
     * negative after 2 and 3 of them, the cosine after 1 and 2. */
    *sine = negate_on_bit1(vec_select(odd, c, s), n);
    *cosine = negate_on_bit1(vec_select(odd, s, c), n + 1);
}

/* Writes sine and cosine of angles x[0..n), n <= ANGLES. x must have room for
 * whole vectors. */
static void put_pairs(real *y, const real *x, int n)
{
    real s[ANGLES], c[ANGLES];
    int i;

    for (i = 0; i < n; i += VEC_LANES) {
        vec sine, cosine;

        turn(&sine, &cosine, vec_load(x + i));
        vec_store(s + i, sine);
        vec_store(c + i, cosine);
    }
    for (i = 0; i < n; i++) {
        y[2 * i] = s[i];
        y[2 * i + 1] = c[i];
    }
}

/* Writes the embedding of one point. */
static void embed(real *at, const real *p, int n_axes, int octaves)
{
    real x[ANGLES] = { 0 };
    int axis, k, n = 0;

    for (axis = 0; axis < n_axes; axis++)
        for (k = 0; k < octaves; k++) {
            /* Full batches are written at once; the last one may be shorter. */
            x[n++] = p[axis] * R(1 << k);
            if (n == ANGLES) {
                put_pairs(at, x, n);
                at += 2 * n;
                n = 0;
            }
        }
    put_pairs(at, x, n);
}

/* Writes the embeddings of m points of four coordinates with one octave, of
 * several points at a time, and returns how many were written. */
static size_t embed_quads(real *y, size_t stride, const real *u, size_t m)
{
    enum { POINTS = VEC_LANES / 4 ? VEC_LANES / 4 : 1 };
    size_t i = 0;

    for (; VEC_LANES >= 4 && i + POINTS <= m; i += POINTS) {
        real s[VEC_LANES], c[VEC_LANES];
        vec sine, cosine;

        turn(&sine, &cosine, vec_load(u + 4 * i));
        vec_store(s, sine);
        vec_store(c, cosine);
        for (size_t point = 0; point < POINTS; point++)
            for (size_t k = 0; k < 4; k++) {
                real *const to = y + (i + point) * stride + 2 * k;

                to[0] = s[4 * point + k];
                to[1] = c[4 * point + k];
            }
    }
    return i;
}

void saga_embedding_forward(real *y, size_t stride, const real *u, size_t m,
                            int n_axes, int octaves)
{
    size_t i = n_axes == 4 && octaves == 1 ? embed_quads(y, stride, u, m) : 0;

    for (; i < m; i++)
        embed(y + i * stride, u + i * (size_t)n_axes, n_axes, octaves);
}

SAGA_ISA_CHOOSE(saga_embedding_forward);
