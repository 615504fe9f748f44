/* SPDX-License-Identifier: MIT */
#include "adam.h"

#include "vec.h"

enum { PART = 4096 };        /* reals a thread takes at a time */

saga_adam saga_adam_default(void)
{
    return (saga_adam){ R(0.9), R(0.999), R(1e-15), R(4) };
}

/* x * 0 is 0 for finite x, NaN otherwise. */
static int part_is_finite(const real *x, size_t n)
{
    vec sum = vec_zero();
    real rest = 0;
    size_t i;

    for (i = 0; i + VEC_LANES <= n; i += VEC_LANES)
        sum += vec_load(x + i) * R(0);
    for (; i < n; i++)
        rest += x[i] * 0;
    return vec_sum(sum) + rest == 0;
}

/* Returns the index of the first value that is not finite, or n. */
static size_t first_fault(const real *x, size_t n)
{
    const int64_t n_parts = (int64_t)((n + PART - 1) / PART);
    int64_t bad = n_parts, k;
    size_t i;

#pragma omp parallel for schedule(static) reduction(min : bad)
    for (k = 0; k < n_parts; k++) {
        const size_t begin = (size_t)k * PART;

        if (!part_is_finite(x + begin, n - begin < PART ? n - begin : PART) &&
            k < bad)
            bad = k;
    }
    if (bad == n_parts)
        return n;
    i = (size_t)bad * PART;
    while (x[i] * 0 == 0)
        i++;
    return i;
}

static bool is_finite(const real *x, const char *what,
                      const saga_adam_tensor *t, uint64_t step,
                      saga_error *error)
{
    const size_t i = first_fault(x, t->n);

    return i == t->n ||
           saga_fail(error, NULL, "try another --seed, and report it", "number "
                     "%zu of the %s of the %s is not finite at step %llu", i,
                     what, t->name, (unsigned long long)step);
}

/* A step is x -= (rate / c1) m / (sqrt(v) / sqrt(c2) + eps). */
typedef struct {
    vec beta1, rest1, beta2, rest2, rate, scale, eps, most;
} factors;

static inline vec step_of(vec *m, vec *v, vec g, const factors *f)
{
    vec sigma, most;

    *v = vec_fma(f->beta2, *v, f->rest2 * (g * g));
    sigma = vec_fma(vec_sqrt(*v), f->scale, f->eps);
    most = f->most * sigma;
    g = vec_min(vec_max(g, -most), most);
    *m = vec_fma(f->beta1, *m, f->rest1 * g);
    return f->rate * *m / sigma;
}

static void step_part(const saga_adam_tensor *t, size_t begin, size_t n,
                      const factors *f)
{
    real *const x = t->x + begin, *const m = t->m + begin;
    real *const v = t->v + begin;
    const real *const g = t->g + begin;
    real tail[4][VEC_LANES] = { { 0 } };
    vec mi, vi;
    size_t i, k;

    for (i = 0; i + VEC_LANES <= n; i += VEC_LANES) {
        mi = vec_load(m + i);
        vi = vec_load(v + i);
        vec_store(x + i, vec_load(x + i) - step_of(&mi, &vi, vec_load(g + i),
                                                   f));
        vec_store(m + i, mi);
        vec_store(v + i, vi);
    }
    if (i == n)
        return;
    for (k = 0; k < n - i; k++) {
        tail[0][k] = m[i + k];
        tail[1][k] = v[i + k];
        tail[2][k] = g[i + k];
    }
    mi = vec_load(tail[0]);
    vi = vec_load(tail[1]);
    vec_store(tail[3], step_of(&mi, &vi, vec_load(tail[2]), f));
    for (k = 0; k < n - i; k++) {
        x[i + k] -= tail[3][k];
        m[i + k] = mi[k];
        v[i + k] = vi[k];
    }
}

static void step_tensor(const saga_adam_tensor *t, const saga_adam *adam,
                        uint64_t step)
{
    const double c1 = 1 - pow((double)adam->beta1, (double)step);
    const double c2 = 1 - pow((double)adam->beta2, (double)step);
    const factors f = {
        vec_set1(adam->beta1), vec_set1(1 - adam->beta1),
        vec_set1(adam->beta2), vec_set1(1 - adam->beta2),
        vec_set1(R((double)t->rate / c1)), vec_set1(R(1 / sqrt(c2))),
        vec_set1(adam->eps), vec_set1(adam->most)
    };
    const int64_t n_parts = (int64_t)((t->n + PART - 1) / PART);
    int64_t k;

#pragma omp parallel for schedule(static)
    for (k = 0; k < n_parts; k++) {
        const size_t begin = (size_t)k * PART;

        step_part(t, begin, t->n - begin < PART ? t->n - begin : PART, &f);
    }
}

bool saga_adam_update(const saga_adam *adam, const saga_adam_tensor *tensors,
                      size_t n_tensors, uint64_t step, saga_error *error)
{
    size_t k;

    for (k = 0; k < n_tensors; k++)
        if (!is_finite(tensors[k].g, "gradients", tensors + k, step, error) ||
            !is_finite(tensors[k].x, "values", tensors + k, step, error))
            return false;
    for (k = 0; k < n_tensors; k++)
        if (tensors[k].rate > 0)
            step_tensor(tensors + k, adam, step);
    return true;
}
