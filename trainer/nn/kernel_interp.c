/* SPDX-License-Identifier: MIT
 *
 * Backward in two passes without conflicts: over the queries (distances, and
 * what belongs to the query), then over the sources, each of which sums what
 * its queries left, in their order.
 */
#include "kernel_interp.h"

#include "vec.h"

#include <stdlib.h>
#include <string.h>

enum { AXES = 4 };

#define DISTANCE_MAX R(16)
#define LOG2_E R(1.4426950408889634)
#define EXPONENT_MAX R(100)      /* of vec_exp2_neg; as good as 0 */

/* to += w from */
static void add_scaled(real *to, const real *from, real w, size_t n)
{
    const vec wide = vec_set1(w);
    size_t i;

    for (i = 0; i + VEC_LANES <= n; i += VEC_LANES)
        vec_store(to + i, vec_fma(wide, vec_load(from + i),
                                  vec_load(to + i)));
    for (; i < n; i++)
        to[i] += w * from[i];
}

static real dot(const real *a, const real *b, size_t n)
{
    vec sum = vec_zero();
    real rest = 0;
    size_t i;

    for (i = 0; i + VEC_LANES <= n; i += VEC_LANES)
        sum = vec_fma(vec_load(a + i), vec_load(b + i), sum);
    for (; i < n; i++)
        rest += a[i] * b[i];
    return vec_sum(sum) + rest;
}

void saga_kernel_free(saga_kernel_work *work)
{
    free(work->begin);
    free(work->entry);
    free(work->weight);
    free(work->d_distance);
    memset(work, 0, sizeof *work);
}

static int grow(void **p, size_t *cap, size_t nbytes)
{
    if (nbytes <= *cap)
        return 0;
    free(*p);
    *p = malloc(nbytes);
    *cap = *p ? nbytes : 0;
    return *p ? 0 : -1;
}

int saga_kernel_link(saga_kernel_work *work, const saga_kernel *k)
{
    const size_t per = (size_t)k->max_neighbours;
    const size_t n = k->n_queries * per;
    size_t i, j, b;

    if (grow((void **)&work->begin, &work->cap[0],
             (k->n_sources + 2) * sizeof *work->begin) ||
        grow((void **)&work->entry, &work->cap[1], n * sizeof *work->entry) ||
        grow((void **)&work->weight, &work->cap[2], n * sizeof(real)) ||
        grow((void **)&work->d_distance, &work->cap[3], n * sizeof(real)))
        return -1;
    /* Counts two places on, so that after the scatter begin[b] is right. */
    memset(work->begin, 0, (k->n_sources + 2) * sizeof *work->begin);
    for (i = 0; i < k->n_queries; i++)
        for (j = 0; j < k->count[i]; j++)
            work->begin[k->index[i * per + j] + 2u]++;
    for (b = 2; b < k->n_sources + 2; b++)
        work->begin[b] += work->begin[b - 1];
    for (i = 0; i < k->n_queries; i++)
        for (j = 0; j < k->count[i]; j++)
            work->entry[work->begin[k->index[i * per + j] + 1u]++] =
                (uint32_t)(i * per + j);
    return 0;
}

/* The axes of a pair side by side: one division for the four. */
typedef real axes __attribute__((vector_size(AXES * sizeof(real))));

/* Per axis u and 1 / (l_query + l_source); returns d before the limit. */
static inline real distance(real *u, real *recip, const saga_kernel_values *v,
                            const saga_kernel *k, size_t query, size_t source)
{
    const axes one = { 1, 1, 1, 1 };
    const axes lambda = { 1, 1, 1, k->lambda_t };
    axes q, s, lq, ls, square;

    memcpy(&q, v->query + AXES * query, sizeof q);
    memcpy(&s, v->source + AXES * source, sizeof s);
    memcpy(&lq, v->query_support + AXES * query, sizeof lq);
    memcpy(&ls, v->source_support + AXES * source, sizeof ls);
    ls = one / (lq + ls);
    q = (q - s) * ls;
    square = lambda * q * q;
    memcpy(u, &q, sizeof q);
    memcpy(recip, &ls, sizeof ls);
    return (square[0] + square[1]) + (square[2] + square[3]);
}

/* Distances to weights; the nearest has exponent 0. */
static void softmax(real *w, size_t n, real temperature)
{
    real e[SAGA_KERNEL_NEIGHBOURS] = { 0 };
    const vec scale = vec_set1(LOG2_E / temperature);
    real least = w[0], sum = 0;
    size_t j;

    for (j = 1; j < n; j++)
        least = w[j] < least ? w[j] : least;
    for (j = 0; j < n; j++)
        e[j] = w[j] - least;
    for (j = 0; j < n; j += VEC_LANES)
        vec_store(e + j, vec_exp2_neg(vec_min(vec_load(e + j) * scale,
                                              vec_set1(EXPONENT_MAX))));
    for (j = 0; j < n; j++)
        sum += e[j];
    for (j = 0; j < n; j++)
        w[j] = e[j] / sum;
}

void saga_kernel_forward(real *out, saga_kernel_work *work,
                         const saga_kernel_values *v, const saga_kernel *k)
{
    const size_t n_f = (size_t)k->n_features;
    const size_t per = (size_t)k->max_neighbours;
    int64_t q;

#pragma omp parallel for schedule(static)
    for (q = 0; q < (int64_t)k->n_queries; q++) {
        const size_t i = (size_t)q, n = k->count[i];
        const uint32_t *const index = k->index + i * per;
        real *const w = work->weight + i * per;
        real *const o = out + i * n_f;
        real u[AXES], recip[AXES];
        size_t j, f;

        for (j = 0; j < n; j++) {
            w[j] = distance(u, recip, v, k, i, index[j]);
            w[j] = w[j] > DISTANCE_MAX ? DISTANCE_MAX : w[j];
        }
        if (n > 0)
            softmax(w, n, k->temperature);
        for (f = 0; f < n_f; f++)
            o[f] = 0;
        for (j = 0; j < n; j++)
            add_scaled(o, v->feature + index[j] * n_f, w[j], n_f);
    }
}

/* dL/dd of each neighbour: w (d_out.f - d_out.out) / -T. */
static void distances_backward(real *dd, const real *d_out, const real *w,
                               const uint32_t *index, size_t n,
                               const saga_kernel_values *v,
                               const saga_kernel *k)
{
    const size_t n_f = (size_t)k->n_features;
    real mean = 0;
    size_t j;

    for (j = 0; j < n; j++) {
        dd[j] = dot(d_out, v->feature + index[j] * n_f, n_f);
        mean += w[j] * dd[j];
    }
    for (j = 0; j < n; j++)
        dd[j] = w[j] * (mean - dd[j]) / k->temperature;
}

/* Adds one pair's part to a position and its support: sign +1 for the query,
 * -1 for the source. */
static void pair_backward(real *d_place, real *d_support, real dd, real sign,
                          size_t query, size_t source,
                          const saga_kernel_values *v, const saga_kernel *k)
{
    real u[AXES], recip[AXES];
    size_t a;

    if (distance(u, recip, v, k, query, source) > DISTANCE_MAX)
        return;
    for (a = 0; a < AXES; a++) {
        const real lambda = a == 3 ? k->lambda_t : 1;
        const real d_u = 2 * lambda * u[a] * dd * recip[a];

        if (d_place)
            d_place[a] += sign * d_u;
        if (d_support)
            d_support[a] -= u[a] * d_u;
    }
}

static real *row(real *p, size_t i)
{
    return p ? p + AXES * i : NULL;
}

static void queries_backward(saga_kernel_values *d, saga_kernel_work *work,
                             const real *d_out, const saga_kernel_values *v,
                             const saga_kernel *k)
{
    const size_t per = (size_t)k->max_neighbours;
    int64_t q;

#pragma omp parallel for schedule(static)
    for (q = 0; q < (int64_t)k->n_queries; q++) {
        const size_t i = (size_t)q, n = k->count[i];
        real *const dd = work->d_distance + i * per;
        size_t j;

        distances_backward(dd, d_out + i * (size_t)k->n_features,
                           work->weight + i * per, k->index + i * per, n, v,
                           k);
        for (j = 0; j < n && (d->query || d->query_support); j++)
            pair_backward(row(d->query, i), row(d->query_support, i), dd[j], 1,
                          i, k->index[i * per + j], v, k);
    }
}

void saga_kernel_backward(saga_kernel_values *d, saga_kernel_work *work,
                          const real *d_out, const saga_kernel_values *v,
                          const saga_kernel *k)
{
    const size_t n_f = (size_t)k->n_features;
    const int to_places = d->source || d->source_support;
    int64_t s;

    if (to_places || d->query || d->query_support)
        queries_backward(d, work, d_out, v, k);
#pragma omp parallel for schedule(static)
    for (s = 0; s < (int64_t)k->n_sources; s++) {
        const size_t b = (size_t)s;
        uint32_t e;

        for (e = work->begin[b]; e < work->begin[b + 1]; e++) {
            const uint32_t at = work->entry[e];
            const size_t i = at / (uint32_t)k->max_neighbours;

            if (d->feature)
                add_scaled(d->feature + b * n_f, d_out + i * n_f,
                           work->weight[at], n_f);
            if (to_places)
                pair_backward(row(d->source, b), row(d->source_support, b),
                              work->d_distance[at], -1, i, b, v, k);
        }
    }
}
