/* SPDX-License-Identifier: MIT
 *
 * Each lane of a wide has a block, since a block alone is a chain of dependent
 * sums. The blocks of a group are SAGA_BLOCK_TURN_EVERY apart, so that all of
 * them turn in the same step. Covariances are large and needed only where axes
 * turn, so the gradients of several steps are kept and added to them together.
 */
#include "block_adam.h"

#include "threads.h"
#include "wide.h"

#include <assert.h>

/* This part of the trace is added to the diagonal. It does not change axes with
 * gradients, and keeps axes without any linearly independent. */
#define RIDGE R(1e-5)

/* Groups in one task, and nanoseconds for each number of a block's matrix. */
enum { GROUPS = 10 };
#define ENTRY_NS 0.25

enum {
    LANES = SAGA_BLOCK_LANES,
    RECENT = SAGA_BLOCK_RECENT,
    APART = SAGA_BLOCK_TURN_EVERY,
    MOST = SAGA_MAX_FEATURES
};
_Static_assert((int)LANES == (int)WIDE_LANES, "a lane for each block");
_Static_assert(APART % RECENT == 0, "covariances are complete where axes turn");

/* A step of all blocks. */
typedef struct {
    const saga_block_adam *b;
    const saga_adam *adam;
    uint64_t step;
    real c1, c2; /* 1 - beta^step */
} job;

/* The state of a group, as it lies in memory (block_adam.h). */
typedef struct {
    real *axes, *m, *v, *covariance, *recent;
    size_t n, first; /* width; the block of lane 0 */
} group;

static size_t n_groups(size_t n)
{
    const size_t rest = n % ((size_t)APART * LANES);

    return n / ((size_t)APART * LANES) * APART + (rest < APART ? rest : APART);
}

static size_t group_size(size_t width)
{
    return LANES * width * (2 * width + 2 + RECENT);
}

size_t saga_block_adam_size(size_t n, size_t width)
{
    return n_groups(n) * group_size(width);
}

static group group_of(const saga_block_adam *b, size_t k)
{
    const size_t n = b->width, matrix = LANES * n * n;
    real *const axes = b->state + k * group_size(n);
    real *const m = axes + matrix, *const v = m + LANES * n;
    real *const covariance = v + LANES * n;

    return (group){ .axes = axes,
                    .m = m,
                    .v = v,
                    .covariance = covariance,
                    .recent = covariance + matrix,
                    .n = n,
                    .first = k / APART * APART * LANES + k % APART };
}

static wide at(const real *rows, size_t i)
{
    return wide_load(rows + LANES * i);
}

static void put(real *rows, size_t i, wide a)
{
    wide_store(rows + LANES * i, a);
}

/* Returns a dot product, as four interleaved sums. */
static inline wide dot(const real *a, const real *b, size_t n)
{
    wide sum[4] = { wide_zero(), wide_zero(), wide_zero(), wide_zero() };

    for (size_t i = 0; i < n; i += 4) {
        WIDE_UNROLL
        for (size_t k = 0; k < 4; k++)
            sum[k] = wide_add(sum[k], wide_mul(at(a, i + k), at(b, i + k)));
    }
    return wide_add(wide_add(sum[0], sum[1]), wide_add(sum[2], sum[3]));
}

/* Adds sum_k factor_k row_k to y (n), in the order of k, for n_rows rows. Four
 * numbers of y are in registers at a time. */
static inline void add_rows(real *y, const real *factor, const real *rows,
                            size_t n_rows, size_t n)
{
    for (size_t l = 0; l < n; l += 4) {
        wide sum[4];

        WIDE_UNROLL
        for (size_t i = 0; i < 4; i++)
            sum[i] = at(y, l + i);
        for (size_t k = 0; k < n_rows; k++) {
            const wide f = at(factor, k);

            WIDE_UNROLL
            for (size_t i = 0; i < 4; i++)
                sum[i] = wide_add(sum[i], wide_mul(f, at(rows, k * n + l + i)));
        }
        WIDE_UNROLL
        for (size_t i = 0; i < 4; i++)
            put(y, l + i, sum[i]);
    }
}

/* --- Turns --------------------------------------------------------------- */

/* Makes row k of y a unit vector orthogonal to the previous rows. */
static void orthogonalise(real *y, size_t k, size_t n)
{
    real *const row = y + LANES * k * n;
    real minus[LANES];
    wide length;

    /* Two passes are needed: if the result is small, the rounding error of the
     * first pass is about as large. */
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < k; i++) {
            const real *const other = y + LANES * i * n;

            put(minus, 0, wide_sub(wide_zero(), dot(row, other, n)));
            add_rows(row, minus, other, 1, n);
        }
    length = wide_sqrt(dot(row, row, n));
    for (size_t i = 0; i < n; i++)
        put(row, i, wide_div(at(row, i), length));
}

/* Rotates axes towards the eigenvectors of their covariances, by one step of
 * orthogonal iteration, which converges over the updates. m is rotated with
 * them; v is computed from the covariance for the new axes. Without a gradient
 * yet, axes stay as they are. */
static void turn(const group *t)
{
    const size_t n = t->n;
    real world[LANES * MOST] = { 0 }, row[LANES * MOST];
    wide trace = wide_zero();
    wide_mask has;

    for (size_t i = 0; i < n; i++)
        trace = wide_add(trace, at(t->covariance, i * n + i));
    has = wide_less(wide_zero(), trace);
    add_rows(world, t->m, t->axes, n, n);
    /* Row k becomes (C + ridge) axis k. */
    for (size_t k = 0; k < n; k++) {
        real *const axis = t->axes + LANES * k * n;

        for (size_t i = 0; i < n; i++) {
            const wide along = dot(t->covariance + LANES * i * n, axis, n);
            const wide old = at(axis, i);
            const wide next = wide_add(wide_div(along, trace),
                                       wide_mul(wide_set1(RIDGE), old));

            put(row, i, wide_select(has, next, old));
        }
        memcpy(axis, row, LANES * n * sizeof *row);
    }
    for (size_t k = 0; k < n; k++)
        orthogonalise(t->axes, k, n);
    for (size_t k = 0; k < n; k++) {
        const real *const axis = t->axes + LANES * k * n;
        /* Keeps v positive along axes without gradients, where m is only
         * rounding error. */
        wide v = wide_mul(wide_set1(RIDGE), trace);

        for (size_t i = 0; i < n; i++)
            v = wide_add(v,
                         wide_mul(at(axis, i),
                                  dot(t->covariance + LANES * i * n, axis, n)));
        put(t->m, k, dot(axis, world, n));
        put(t->v, k, v);
    }
}

/* --- Steps --------------------------------------------------------------- */

/* Returns where the numbers of a lane's block begin in the rows, and sets *n to
 * how many it has; a lane without a block has none. */
static size_t begin_of(size_t *n, const saga_block_adam *b, const group *t,
                       size_t lane)
{
    const size_t i = t->first + lane * APART;
    saga_block_span has = { 0, i < b->n ? (uint8_t)b->width : 0 };

    if (b->span && i < b->n)
        has = b->span[i];
    *n = has.n;
    return i * b->stride + has.first;
}

/* Copies the rows of a group's blocks to `to` (width, LANES). Numbers that a
 * block lacks are 0: they have no gradient, and their axes stay those of the
 * coordinates. */
static void take(real *to, const saga_block_adam *b, const group *t,
                 const real *from)
{
    memset(to, 0, LANES * t->n * sizeof *to);
    for (size_t lane = 0; lane < LANES; lane++) {
        size_t n;
        const size_t begin = begin_of(&n, b, t, lane);

        for (size_t k = 0; k < n; k++)
            to[LANES * k + lane] = from[begin + k];
    }
}

static void give(const saga_block_adam *b, const group *t, const real *x)
{
    for (size_t lane = 0; lane < LANES; lane++) {
        size_t n;
        const size_t begin = begin_of(&n, b, t, lane);

        for (size_t k = 0; k < n; k++)
            b->x[begin + k] = x[LANES * k + lane];
    }
}

/* Keeps the gradients g of a group. After RECENT steps it adds these gradients
 * to the covariances in order, C = beta2 C + (1 - beta2) g g^T: like Adam's v,
 * but the whole matrix. */
static void remember(const job *j, const group *t, const real *g)
{
    const size_t n = t->n, row = LANES * n;
    const size_t now = (j->step + t->first + RECENT - 1) % RECENT;
    const wide beta2 = wide_set1(j->adam->beta2);
    const wide rest2 = wide_set1(1 - j->adam->beta2);

    memcpy(t->recent + now * row, g, row * sizeof *g);
    if (now < RECENT - 1)
        return;
    for (size_t k = 0; k < n; k++) {
        wide part[RECENT]; /* (1 - beta2) g_k */

        for (size_t p = 0; p < RECENT; p++)
            part[p] = wide_mul(rest2, at(t->recent + p * row, k));
        for (size_t l = 0; l < n; l++) {
            wide c = at(t->covariance, k * n + l);

            WIDE_UNROLL
            for (size_t p = 0; p < RECENT; p++)
                c = wide_add(wide_mul(c, beta2),
                             wide_mul(part[p], at(t->recent + p * row, l)));
            put(t->covariance, k * n + l, c);
        }
    }
}

/* Sets r to the gradients g along the axes. */
static void look_along(real *r, const group *t, const real *g)
{
    for (size_t k = 0; k < t->n; k++)
        put(r, k, dot(t->axes + LANES * k * t->n, g, t->n));
}

/* Updates v by the gradients r along the axes. */
static void spread(const job *j, const group *t, const real *r)
{
    const wide beta2 = wide_set1(j->adam->beta2);
    const wide rest2 = wide_set1(1 - j->adam->beta2);

    for (size_t k = 0; k < t->n; k++) {
        const wide d = at(r, k);

        put(t->v, k,
            wide_add(wide_mul(beta2, at(t->v, k)),
                     wide_mul(wide_mul(rest2, d), d)));
    }
}

/* Replaces r, the gradients along the axes, by Adam's steps along them. The
 * gradients are limited as in adam.c. */
static void step_along(const job *j, const group *t, real *r)
{
    const saga_adam *const a = j->adam;
    const wide minus_rate = wide_set1(-j->b->rate);

    for (size_t k = 0; k < t->n; k++) {
        const wide v = wide_max(at(t->v, k), wide_zero());
        const wide sigma = wide_add(wide_sqrt(wide_div(v, wide_set1(j->c2))),
                                    wide_set1(a->eps));
        const wide most = wide_mul(wide_set1(a->most), sigma);
        const wide least = wide_sub(wide_zero(), most);
        const wide g = wide_max(wide_min(at(r, k), most), least);
        const wide m = wide_add(wide_mul(wide_set1(a->beta1), at(t->m, k)),
                                wide_mul(wide_set1(1 - a->beta1), g));

        put(t->m, k, m);
        put(r, k,
            wide_div(wide_mul(minus_rate, m),
                     wide_mul(wide_set1(j->c1), sigma)));
    }
}

static void step_group(const job *j, const group *t)
{
    real g[LANES * MOST], r[LANES * MOST], x[LANES * MOST];
    const bool turns = (j->step + t->first) % APART == 0;

    take(g, j->b, t, j->b->g);
    remember(j, t, g);
    if (turns)
        turn(t);
    look_along(r, t, g);
    /* A turn computes v from the covariance, which has this gradient. */
    if (!turns)
        spread(j, t, r);
    step_along(j, t, r);
    take(x, j->b, t, j->b->x);
    add_rows(x, r, t->axes, t->n, t->n);
    give(j->b, t, x);
}

static void step_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = saga_part(n_groups(j->b->n), GROUPS, part);

    for (size_t k = of.begin; k < of.end; k++) {
        const group t = group_of(j->b, k);

        step_group(j, &t);
    }
}

void saga_block_adam_begin(const saga_block_adam *b)
{
    const size_t n = b->width;

    assert(b->span || b->stride == n);
    assert(n % 4 == 0 && n <= MOST);
    memset(b->state, 0, saga_block_adam_size(b->n, n) * sizeof *b->state);
    for (size_t i = 0; i < n_groups(b->n); i++)
        for (size_t k = 0; k < n; k++)
            put(group_of(b, i).axes, k * n + k, wide_set1(1));
}

void saga_block_adam_update(const saga_block_adam *b, const saga_adam *adam,
                            uint64_t step)
{
    job j = { .b = b,
              .adam = adam,
              .step = step,
              .c1 = R(1 - pow((double)adam->beta1, (double)step)),
              .c2 = R(1 - pow((double)adam->beta2, (double)step)) };

    saga_parallel(
        &(saga_tasks){ .run = step_part,
                       .user = &j,
                       .n = saga_n_parts(n_groups(b->n), GROUPS),
                       .ns = ENTRY_NS * (double)(b->n * b->width * b->width) });
}

SAGA_ISA_CHOOSE(saga_block_adam_size);
SAGA_ISA_CHOOSE(saga_block_adam_begin);
SAGA_ISA_CHOOSE(saga_block_adam_update);
