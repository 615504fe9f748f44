/* SPDX-License-Identifier: MIT
 *
 * Rows are read in quads, since a width is a multiple of four. Covariances are
 * large and needed only where axes turn, so the gradients of several steps are
 * kept and added to them together. Blocks that turn in the same step are turned
 * together, one in each lane of a vector, since a block alone is a chain of
 * dependent sums.
 */
#include "block_adam.h"

#include "threads.h"
#include "vec.h"

#include <assert.h>

/* This part of the trace is added to the diagonal. It does not change axes with
 * gradients, and keeps axes without any linearly independent. */
#define RIDGE R(1e-5)

/* Blocks in one task, of which as many turn in a step as a vector has lanes;
 * and nanoseconds for each number of a matrix. */
enum { BLOCKS = 8 * SAGA_BLOCK_TURN_EVERY };
#define ENTRY_NS 0.6

enum { RECENT = SAGA_BLOCK_RECENT, MOST = SAGA_MAX_FEATURES };
_Static_assert(SAGA_BLOCK_TURN_EVERY % RECENT == 0, "covariances are complete "
                                                    "where axes turn");

/* A step of all blocks. */
typedef struct {
    const saga_block_adam *b;
    const saga_adam *adam;
    uint64_t step;
    real c1, c2; /* 1 - beta^step */
} job;

typedef real quad __attribute__((vector_size(4 * sizeof(real))));

/* --- Turns --------------------------------------------------------------- */

/* The state of as many blocks as a vector has lanes. */
typedef struct {
    vec covariance[MOST * MOST], axes[MOST * MOST], turned[MOST * MOST];
    vec m[MOST], v[MOST], trace; /* trace: of the covariance */
} lanes;

/* Copies n reals of a block to or from a lane. */
static void to_lane(vec *to, const real *from, int lane, size_t n)
{
    for (size_t i = 0; i < n; i++)
        ((real *)&to[i])[lane] = from[i];
}

static void from_lane(real *to, const vec *from, int lane, size_t n)
{
    for (size_t i = 0; i < n; i++)
        to[i] = ((const real *)&from[i])[lane];
}

/* Sets *to to the dot product, as four interleaved sums in the order of
 * dot_rows. */
static void dot(vec *to, const vec *a, const vec *b, size_t n)
{
    vec sum[4] = { vec_zero(), vec_zero(), vec_zero(), vec_zero() };

    for (size_t i = 0; i < n; i += 4)
        for (size_t k = 0; k < 4; k++)
            sum[k] += a[i + k] * b[i + k];
    *to = (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

/* Adds a x to y. */
static void add(vec *y, const vec *a, const vec *x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        y[i] += *a * x[i];
}

/* Makes row k of y a unit vector orthogonal to the previous rows. */
static void orthogonalise(vec *y, size_t k, size_t n)
{
    vec *const row = y + k * n;
    vec length;

    /* Two passes are needed: if the result is small, the rounding error of the
     * first pass is about as large. */
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < k; i++) {
            vec along;

            dot(&along, row, y + i * n, n);
            along = -along;
            add(row, &along, y + i * n, n);
        }
    dot(&length, row, row, n);
    length = vec_sqrt(length);
    for (size_t i = 0; i < n; i++)
        row[i] /= length;
}

/* Rotates axes towards the eigenvectors of their covariances, by one step of
 * orthogonal iteration, which converges over the updates. m is rotated with
 * them; v is computed from the covariance for the new axes. */
static void turn_lanes(lanes *t, size_t n)
{
    vec world[MOST], along;

    t->trace = vec_zero();
    for (size_t i = 0; i < n; i++)
        t->trace += t->covariance[i * n + i];
    /* Row k becomes (C + ridge) axis k. */
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < n; i++) {
            dot(&along, t->covariance + i * n, t->axes + k * n, n);
            t->turned[k * n + i] = along / t->trace +
                                   RIDGE * t->axes[k * n + i];
        }
    for (size_t k = 0; k < n; k++)
        orthogonalise(t->turned, k, n);
    for (size_t k = 0; k < n; k++)
        world[k] = vec_zero();
    for (size_t k = 0; k < n; k++)
        add(world, &t->m[k], t->axes + k * n, n);
    for (size_t k = 0; k < n; k++) {
        const vec *const row = t->turned + k * n;

        dot(&t->m[k], row, world, n);
        /* Keeps v positive along axes without gradients, where m is only
         * rounding error. */
        t->v[k] = RIDGE * t->trace;
        for (size_t i = 0; i < n; i++) {
            dot(&along, t->covariance + i * n, row, n);
            t->v[k] += row[i] * along;
        }
    }
}

/* Turns n_blocks blocks, first, first + SAGA_BLOCK_TURN_EVERY, ... */
static void turn(const saga_block_adam *b, size_t first, int n_blocks)
{
    const size_t n = b->width, size = n * n;
    lanes t;

    /* Lanes without a block compute with zeros; nobody reads them. */
    if (n_blocks < VEC_LANES) {
        memset(t.covariance, 0, size * sizeof *t.covariance);
        memset(t.axes, 0, size * sizeof *t.axes);
        memset(t.m, 0, n * sizeof *t.m);
    }
    for (int lane = 0; lane < n_blocks; lane++) {
        const size_t i = first + (size_t)lane * SAGA_BLOCK_TURN_EVERY;

        to_lane(t.covariance, b->covariance + i * size, lane, size);
        to_lane(t.axes, b->axes + i * size, lane, size);
        to_lane(t.m, b->m + i * n, lane, n);
    }
    turn_lanes(&t, n);
    for (int lane = 0; lane < n_blocks; lane++) {
        const size_t i = first + (size_t)lane * SAGA_BLOCK_TURN_EVERY;

        /* Without a gradient yet, axes stay as they are. */
        if (!(((const real *)&t.trace)[lane] > 0))
            continue;
        from_lane(b->axes + i * size, t.turned, lane, size);
        from_lane(b->m + i * n, t.m, lane, n);
        from_lane(b->v + i * n, t.v, lane, n);
    }
}

/* --- Steps --------------------------------------------------------------- */

static saga_block_span span_of(const saga_block_adam *b, size_t i)
{
    return b->span ? b->span[i] : (saga_block_span){ 0, (uint8_t)b->width };
}

/* Copies the gradients of block i to g (width). Numbers that it lacks have
 * none, and their axes stay those of the coordinates. */
static void take_gradient(real *g, const saga_block_adam *b, size_t i)
{
    const saga_block_span has = span_of(b, i);

    memset(g, 0, b->width * sizeof *g);
    memcpy(g, b->g + i * b->stride + has.first, has.n * sizeof *g);
}

static inline void load_quad(quad *to, const real *from)
{
    memcpy(to, from, sizeof *to);
}

/* Sets r (n) to the dot products of n rows with x. Each is the sum of four
 * interleaved sums. */
static void dot_rows(real *r, const real *rows, const real *x, size_t n)
{
    for (size_t k = 0; k < n; k += 4) {
        quad sum[4] = { { 0 } }, a, b;

        for (size_t i = 0; i < n; i += 4) {
            load_quad(&b, x + i);
            for (size_t row = 0; row < 4; row++) {
                load_quad(&a, rows + (k + row) * n + i);
                sum[row] += a * b;
            }
        }
        for (size_t row = 0; row < 4; row++)
            r[k + row] = (sum[row][0] + sum[row][1]) +
                         (sum[row][2] + sum[row][3]);
    }
}

/* Keeps the gradient g of block i. After RECENT steps it adds these gradients
 * to the covariance in order, C = beta2 C + (1 - beta2) g g^T: like Adam's v,
 * but the whole matrix. */
static void remember(const job *j, size_t i, const real *g)
{
    const saga_block_adam *const b = j->b;
    const size_t n = b->width, at = (j->step + i + RECENT - 1) % RECENT;
    const real beta2 = j->adam->beta2;
    real *const recent = b->recent + i * RECENT * n;
    real *const covariance = b->covariance + i * n * n;

    memcpy(recent + at * n, g, n * sizeof *recent);
    if (at < RECENT - 1)
        return;
    for (size_t k = 0; k < n; k++)
        for (size_t l = 0; l < n; l += 4) {
            quad c, y;

            load_quad(&c, covariance + k * n + l);
            for (size_t p = 0; p < RECENT; p++) {
                load_quad(&y, recent + p * n + l);
                c = c * beta2 + ((1 - beta2) * recent[p * n + k]) * y;
            }
            memcpy(covariance + k * n + l, &c, sizeof c);
        }
}

/* Updates v by the gradients r along the axes. */
static void spread(const job *j, real *v, const real *r, size_t n)
{
    const real beta2 = j->adam->beta2;

    for (size_t k = 0; k < n; k++)
        v[k] = beta2 * v[k] + (1 - beta2) * r[k] * r[k];
}

/* Moves block i along its axes by Adam, with r, the gradient along the axes,
 * limited as in adam.c. r has whole vectors. */
static void step_block(const job *j, size_t i, const real *r)
{
    const saga_block_adam *const b = j->b;
    const saga_adam *const a = j->adam;
    const size_t n = b->width;
    const real *const axes = b->axes + i * n * n;
    const saga_block_span has = span_of(b, i);
    real *const x = b->x + i * b->stride + has.first;
    real to[MOST];
    /* Lanes after the last number compute with zeros. */
    real m[MOST + VEC_LANES], v[MOST + VEC_LANES], along[MOST + VEC_LANES];

    vec_store(m + n, vec_zero());
    vec_store(v + n, vec_zero());
    saga_copy_row(m, b->m + i * n, n);
    saga_copy_row(v, b->v + i * n, n);
    for (size_t k = 0; k < n; k += VEC_LANES) {
        const vec positive = vec_max(vec_load(v + k), vec_zero());
        const vec sigma = vec_sqrt(positive / j->c2) + a->eps;
        const vec most = a->most * sigma;
        const vec g = vec_max(vec_min(vec_load(r + k), most), -most);
        const vec mean = a->beta1 * vec_load(m + k) + (1 - a->beta1) * g;

        vec_store(m + k, mean);
        vec_store(along + k, -b->rate * mean / (j->c1 * sigma));
    }
    saga_copy_row(b->m + i * n, m, n);
    memset(to, 0, n * sizeof *to);
    memcpy(to, x, has.n * sizeof *to);
    for (size_t l = 0; l < n; l += 4) {
        quad sum, axis;

        load_quad(&sum, to + l);
        for (size_t k = 0; k < n; k++) {
            load_quad(&axis, axes + k * n + l);
            sum += along[k] * axis;
        }
        memcpy(to + l, &sum, sizeof sum);
    }
    memcpy(x, to, has.n * sizeof *to);
}

static bool turns(const job *j, size_t i)
{
    return (j->step + i) % SAGA_BLOCK_TURN_EVERY == 0;
}

static void step_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_block_adam *const b = j->b;
    const saga_range of = saga_part(b->n, BLOCKS, part);
    const size_t n = b->width;
    size_t first = of.end, n_turning = 0;
    real r[MOST + VEC_LANES] = { 0 }, g[MOST];

    for (size_t i = of.begin; i < of.end; i++) {
        take_gradient(g, b, i);
        remember(j, i, g);
        dot_rows(r, b->axes + i * n * n, g, n);
        spread(j, b->v + i * n, r, n);
        if (!turns(j, i))
            step_block(j, i, r);
        else if (n_turning++ == 0)
            first = i;
    }
    /* Blocks that turn step along their new axes. */
    for (size_t k = 0; k < n_turning; k += VEC_LANES)
        turn(b, first + k * SAGA_BLOCK_TURN_EVERY,
             (int)(n_turning - k < VEC_LANES ? n_turning - k : VEC_LANES));
    for (size_t i = first; i < of.end; i += SAGA_BLOCK_TURN_EVERY) {
        take_gradient(g, b, i);
        dot_rows(r, b->axes + i * n * n, g, n);
        step_block(j, i, r);
    }
}

void saga_block_adam_begin(const saga_block_adam *b)
{
    const size_t n = b->width;

    assert(b->span || b->stride == n);
    assert(n % 4 == 0 && n <= MOST);
    memset(b->axes, 0, b->n * n * n * sizeof *b->axes);
    for (size_t i = 0; i < b->n; i++)
        for (size_t k = 0; k < n; k++)
            b->axes[(i * n + k) * n + k] = 1;
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
                       .n = saga_n_parts(b->n, BLOCKS),
                       .ns = ENTRY_NS * (double)(b->n * b->width * b->width) });
}

SAGA_ISA_CHOOSE(saga_block_adam_begin);
SAGA_ISA_CHOOSE(saga_block_adam_update);
