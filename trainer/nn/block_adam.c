/* SPDX-License-Identifier: MIT */
#include "block_adam.h"

#include "threads.h"

#include <string.h>
#include <tgmath.h>

/* This part of the trace is added to the diagonal. It does not change axes with
 * gradients, and keeps axes without any linearly independent. */
#define RIDGE R(1e-5)

/* Blocks in one task, and nanoseconds for each number of a matrix. */
enum { BLOCKS = 64 };
#define ENTRY_NS 1.5

/* A step of all blocks. */
typedef struct {
    const saga_block_adam *b;
    const saga_adam *adam;
    uint64_t step;
    real c1, c2; /* 1 - beta^step */
} job;

/* Returns the dot product as four interleaved sums, so that the compiler can
 * use a vector and the order is fixed by the source. */
static real dot(const real *a, const real *b, size_t n)
{
    real sum[4] = { 0 };
    size_t i;

    for (i = 0; i + 4 <= n; i += 4)
        for (size_t k = 0; k < 4; k++)
            sum[k] += a[i + k] * b[i + k];
    for (; i < n; i++)
        sum[0] += a[i] * b[i];
    return (sum[0] + sum[1]) + (sum[2] + sum[3]);
}

static real clamp(real x, real most)
{
    return x > most ? most : x < -most ? -most : x;
}

/* Adds a x to y. */
static void add(real *restrict y, real a, const real *restrict x, size_t n)
{
    for (size_t i = 0; i < n; i++)
        y[i] += a * x[i];
}

/* Makes row k of y a unit vector orthogonal to the previous rows. */
static void orthogonalise(real *y, size_t k, size_t n)
{
    real *const row = y + k * n;
    real length;

    /* Two passes are needed: if the result is small, the rounding error of the
     * first pass is about as large. */
    for (int pass = 0; pass < 2; pass++)
        for (size_t i = 0; i < k; i++)
            add(row, -dot(row, y + i * n, n), y + i * n, n);
    length = sqrt(dot(row, row, n));
    for (size_t i = 0; i < n; i++)
        row[i] /= length;
}

/* Rotates a block's axes towards the eigenvectors of its covariance, by one
 * step of orthogonal iteration, which converges over the updates. m is rotated
 * with them; v is computed from the covariance for the new axes. */
static void turn(real *axes, real *m, real *v, const real *covariance, size_t n)
{
    real y[SAGA_MAX_FEATURES * SAGA_MAX_FEATURES];
    real world[SAGA_MAX_FEATURES] = { 0 };
    real trace = 0;

    for (size_t i = 0; i < n; i++)
        trace += covariance[i * n + i];
    /* The block had no gradient yet, so that its axes stay as they are. */
    if (!(trace > 0))
        return;
    /* Row k becomes (C + ridge) axis k. */
    for (size_t k = 0; k < n; k++)
        for (size_t i = 0; i < n; i++)
            y[k * n + i] = (dot(covariance + i * n, axes + k * n, n) / trace) +
                           RIDGE * axes[k * n + i];
    for (size_t k = 0; k < n; k++)
        orthogonalise(y, k, n);
    for (size_t k = 0; k < n; k++)
        add(world, m[k], axes + k * n, n);
    for (size_t k = 0; k < n; k++) {
        m[k] = dot(y + k * n, world, n);
        /* Keeps v positive along axes without gradients, where m is only
         * rounding error. */
        v[k] = RIDGE * trace;
        for (size_t i = 0; i < n; i++)
            v[k] += y[k * n + i] * dot(covariance + i * n, y + k * n, n);
    }
    memcpy(axes, y, n * n * sizeof *axes);
}

static void step_block(const job *j, size_t i)
{
    const saga_block_adam *const b = j->b;
    const saga_adam *const a = j->adam;
    const size_t n = b->width;
    const real *const g = b->g + i * n;
    real *const axes = b->axes + i * n * n;
    real *const covariance = b->covariance + i * n * n;
    real *const m = b->m + i * n, *const v = b->v + i * n;
    real r[SAGA_MAX_FEATURES];

    /* C = beta2 C + (1 - beta2) g g^T: like Adam's v, but the whole matrix. */
    for (size_t k = 0; k < n; k++) {
        for (size_t l = 0; l < n; l++)
            covariance[k * n + l] *= a->beta2;
        add(covariance + k * n, (1 - a->beta2) * g[k], g, n);
    }
    for (size_t k = 0; k < n; k++) {
        r[k] = dot(axes + k * n, g, n);
        v[k] = a->beta2 * v[k] + (1 - a->beta2) * r[k] * r[k];
    }
    if ((j->step + i) % SAGA_BLOCK_TURN_EVERY == 0) {
        turn(axes, m, v, covariance, n);
        for (size_t k = 0; k < n; k++)
            r[k] = dot(axes + k * n, g, n);
    }
    /* Adam along each axis: r is the gradient there, limited as in adam.c. */
    for (size_t k = 0; k < n; k++) {
        const real sigma = sqrt(fmax(v[k], R(0)) / j->c2) + a->eps;

        m[k] = a->beta1 * m[k] + (1 - a->beta1) * clamp(r[k], a->most * sigma);
        add(b->x + i * n, -b->rate * m[k] / (j->c1 * sigma), axes + k * n, n);
    }
}

static void step_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = saga_part(j->b->n, BLOCKS, part);

    for (size_t i = of.begin; i < of.end; i++)
        step_block(j, i);
}

void saga_block_adam_begin(const saga_block_adam *b)
{
    const size_t n = b->width;

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
