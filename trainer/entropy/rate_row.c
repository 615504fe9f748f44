/* SPDX-License-Identifier: MIT */
#include "rate_row.h"

#include "rate_bits.h"
#include "vec.h"

#ifdef SAGA_REAL_DOUBLE

void saga_rate_cost_row(saga_rate_row *r, size_t n)
{
    size_t i;

    for (i = 0; i < n; i++) {
        const saga_rate_cost c = saga_rate_bits(r->v[i], r->log2_sigma[i]);

        r->bits[i] = c.bits;
        r->d_v[i] = c.d_v;
        r->d_log2_sigma[i] = c.d_log2_sigma;
    }
}

#else

/* Coefficients of p (see P(X > x) in rate_row.h), and of log2(1 + u) / u for 1
 * + u from 2^-1/2 to 2^1/2, with an error of 2.5e-7. */
static const real tail_fit[] = { 0.113698532f,  0.113698579f,   0.104505289f,
                                 0.0851255849f, 0.0675775346f,  0.00350077213f,
                                 0.0739156356f, -0.0865910795f, 0.0245692317f };
static const real log2_fit[] = { 1.44269492f,  -0.721352487f, 0.480931162f,
                                 -0.36026346f, 0.286868871f,  -0.248322839f,
                                 0.235709691f, -0.149733233f };

#define FIT(c, x) polynomial(c, (int)(sizeof(c) / sizeof *(c)), x)

static inline vec polynomial(const real *c, int n, vec x)
{
    vec p = vec_set1(c[n - 1]);
    int i;

    for (i = n - 2; i >= 0; i--)
        p = vec_fma(p, x, vec_set1(c[i]));
    return p;
}

static inline vec absolute(vec x)
{
    return (vec)((vecu)x & 0x7fffffffu);
}

/* Returns e^(-x^2 / 2), or 2^-100 where it is smaller. */
static inline vec bell(vec x)
{
    const vec half_log2e = vec_set1(0.72134752f), most = vec_set1(100);

    return vec_exp2_neg(vec_min(half_log2e * x * x, most));
}

/* Returns P(X > x), where e is bell(x). */
static inline vec tail(vec x, vec e)
{
    const vec one = vec_set1(1);
    const vec t = one / vec_fma(vec_set1(0.285f), absolute(x), one);
    const vec far = e * t * FIT(tail_fit, t);

    return vec_select((veci)(x < vec_zero()), one - far, far);
}

/* Returns log2 x for positive normal numbers. Bits above those of 2^-1/2 count
 * whole octaves. */
static inline vec log2_of(vec x)
{
    const vecu from = (vecu)x - 0x3f3504f3u;
    const veci octaves = (veci)from >> 23;
    const vec u = (vec)((vecu)x - ((vecu)octaves << 23)) - vec_set1(1);

    return vec_fma(u, FIT(log2_fit, u), __builtin_convertvector(octaves, vec));
}

static inline void cost(saga_rate_row *r, size_t at)
{
    const vec v = vec_load(r->v + at);
    /* log2 sigma is at least -22 / 7; the 4 makes the argument positive. */
    const vec per_sigma =
        vec_exp2_neg(vec_load(r->log2_sigma + at) + vec_set1(4)) * 16;
    const vec half = vec_set1(0.5f), density = vec_set1(0.39894228f);
    const vec near = (absolute(v) - half) * per_sigma;
    const vec far = (absolute(v) + half) * per_sigma;
    const vec e_near = bell(near), e_far = bell(far);
    const vec p = tail(near, e_near) - tail(far, e_far);
    const vec spread = vec_fma(v * v, vec_set1(1.0f / 64), vec_set1(1));
    const vec escape = vec_set1(0x1p-21f) / spread;
    /* The difference of two fits may be slightly negative. */
    const vec sum = vec_max(p, vec_zero()) + escape;
    const vec slope = (e_far - e_near) * density * per_sigma;
    const vec d_p = vec_select((veci)(v < vec_zero()), -slope, slope);

    vec_store(r->bits + at, -log2_of(sum));
    vec_store(r->d_v + at,
              (escape * v / (spread * 32) - d_p) * 1.44269504f / sum);
    vec_store(r->d_log2_sigma + at,
              (far * e_far - near * e_near) * density / sum);
}

void saga_rate_cost_row(saga_rate_row *r, size_t n)
{
    size_t i;

    /* The remaining lanes of the last vector get a valid input; their results
     * are not used. */
    for (i = n; i % VEC_LANES; i++)
        r->v[i] = r->log2_sigma[i] = 0;
    for (i = 0; i < n; i += VEC_LANES)
        cost(r, i);
}

#endif

SAGA_ISA_CHOOSE(saga_rate_cost_row);
