/* SPDX-License-Identifier: MIT */
#include "adam.h"

#include "threads.h"
#include "vec.h"

#include <stdatomic.h>

/* About how many reals are in one task, in whole cache lines; and the
 * nanoseconds to check and to step a real. */
enum { SLICE = 4096, LINE = 16 };
#define CHECK_NS 0.15
#define STEP_NS 0.7

saga_adam saga_adam_default(void)
{
    return (saga_adam){ R(0.9), R(0.999), R(1e-15), R(4) };
}

/* Returns whether all numbers are finite: x * 0 is 0 for finite x and NaN
 * otherwise. */
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

/* The inputs that all slices share. */
typedef struct {
    const saga_adam *adam;
    const saga_adam_tensor *tensor;
    size_t n_tensors, n_slices;
    double c1, c2;          /* 1 - beta^step */
    atomic_bool is_unsound; /* something is not finite */
} job;

static saga_range slice_of(const job *j, const saga_adam_tensor *t, size_t k)
{
    return saga_slice(t->n, LINE, k, j->n_slices);
}

static void check_slice(void *user, size_t k)
{
    job *const j = user;
    size_t i;

    for (i = 0; i < j->n_tensors; i++) {
        const saga_adam_tensor *const t = j->tensor + i;
        const saga_range of = slice_of(j, t, k);
        const size_t n = of.end - of.begin;

        if (!part_is_finite(t->g + of.begin, n) ||
            !part_is_finite(t->x + of.begin, n))
            atomic_store(&j->is_unsound, true);
    }
}

/* Returns false with *error naming the first number that is not finite, or true
 * if all are. */
static bool blame(const real *x, const char *what, const saga_adam_tensor *t,
                  uint64_t step, saga_error *error)
{
    size_t i = 0;

    while (i < t->n && x[i] * 0 == 0)
        i++;
    return i == t->n ||
           saga_fail(error, NULL, "try another --seed, and report this error",
                     "number "
                     "%zu of the %s of the %s is not finite at step %llu",
                     i, what, t->name, (unsigned long long)step);
}

/* The factors of a step x -= (rate / c1) m / (sqrt(v) / sqrt(c2) + eps). */
typedef struct {
    vec beta1, rest1, beta2, rest2, rate, scale, eps, most;
} factors;

static inline vec step_of(vec *m, vec *v, vec g, const factors *f)
{
    vec sigma, most;

    /* v uses the gradient as it is; m uses it clamped to `most` deviations by
     * the new v. scale is 1 / sqrt(c2), so sigma is sqrt(v') + eps. */
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
        vec_store(x + i,
                  vec_load(x + i) - step_of(&mi, &vi, vec_load(g + i), f));
        vec_store(m + i, mi);
        vec_store(v + i, vi);
    }
    if (i == n)
        return;
    /* The remaining numbers go through the same vector code with zeros
     * appended, so a result does not depend on where its slice ends. */
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

static factors factors_of(const saga_adam_tensor *t, const job *j)
{
    const saga_adam *const a = j->adam;

    return (factors){ vec_set1(a->beta1),
                      vec_set1(1 - a->beta1),
                      vec_set1(a->beta2),
                      vec_set1(1 - a->beta2),
                      vec_set1(R((double)t->rate / j->c1)),
                      vec_set1(R(1 / sqrt(j->c2))),
                      vec_set1(a->eps),
                      vec_set1(a->most) };
}

static void step_slice(void *user, size_t k)
{
    const job *const j = user;
    size_t i;

    for (i = 0; i < j->n_tensors; i++) {
        const saga_adam_tensor *const t = j->tensor + i;
        const saga_range of = slice_of(j, t, k);
        const factors f = factors_of(t, j);

        if (t->rate > 0)
            step_part(t, of.begin, of.end - of.begin, &f);
    }
}

bool saga_adam_update(const saga_adam *adam, const saga_adam_tensor *tensors,
                      size_t n_tensors, uint64_t step, saga_error *error)
{
    job j = { .adam = adam,
              .tensor = tensors,
              .n_tensors = n_tensors,
              .c1 = 1 - pow((double)adam->beta1, (double)step),
              .c2 = 1 - pow((double)adam->beta2, (double)step) };
    size_t n = 0, k;

    for (k = 0; k < n_tensors; k++)
        n += tensors[k].n;
    /* Everything is checked before anything is changed. The number that is not
     * finite is only searched if there is one. */
    j.n_slices = saga_n_parts(n, SLICE);
    saga_parallel(&(saga_tasks){ .run = check_slice,
                                 .user = &j,
                                 .n = j.n_slices,
                                 .ns = CHECK_NS * (double)n });
    if (atomic_load(&j.is_unsound))
        for (k = 0; k < n_tensors; k++)
            if (!blame(tensors[k].g, "gradients", tensors + k, step, error) ||
                !blame(tensors[k].x, "values", tensors + k, step, error))
                return false;
    saga_parallel(&(saga_tasks){ .run = step_slice,
                                 .user = &j,
                                 .n = j.n_slices,
                                 .ns = STEP_NS * (double)n });
    return true;
}

SAGA_ISA_CHOOSE(saga_adam_default);
SAGA_ISA_CHOOSE(saga_adam_update);
