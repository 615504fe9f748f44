/* SPDX-License-Identifier: MIT
 *
 * Tiles of 4 rows by 2 vectors in eight named accumulators: as many as two
 * fused multiply-adds a cycle need at four cycles each, and an array of them
 * would not stay in registers (gcc 12).
 */
#include "dense.h"

#include "vec.h"

enum { COLUMNS = 2 * VEC_LANES, CHUNK = 64 };

size_t saga_dense_pad(size_t n)
{
    return (n + VEC_LANES - 1) / VEC_LANES * VEC_LANES;
}

static vec rectify(vec x)
{
    return vec_max(x, vec_zero());
}

/* --- y = x w ------------------------------------------------------------- */

/* Where a tile lies and what surrounds it. */
typedef struct {
    const real *x, *w, *bias;
    real *y;
    size_t x_stride, stride;   /* stride: of y and w */
    size_t n_in;
    int relu;
} tile;

static void put(const tile *t, size_t row, size_t column, vec v)
{
    vec_store(t->y + row * t->stride + column, t->relu ? rectify(v) : v);
}

static void tile_4x2(const tile *t, size_t row, size_t column)
{
    const real *const x0 = t->x + row * t->x_stride;
    const real *const x1 = x0 + t->x_stride;
    const real *const x2 = x1 + t->x_stride;
    const real *const x3 = x2 + t->x_stride;
    const real *w = t->w + column;
    vec a0 = vec_zero(), b0 = vec_zero(), a1, b1, a2, b2, a3, b3;
    size_t k;

    if (t->bias) {
        a0 = vec_load(t->bias + column);
        b0 = vec_load(t->bias + column + VEC_LANES);
    }
    a1 = a2 = a3 = a0;
    b1 = b2 = b3 = b0;
    for (k = 0; k < t->n_in; k++, w += t->stride) {
        const vec wa = vec_load(w), wb = vec_load(w + VEC_LANES);
        const vec v0 = vec_set1(x0[k]), v1 = vec_set1(x1[k]);
        const vec v2 = vec_set1(x2[k]), v3 = vec_set1(x3[k]);

        a0 = vec_fma(v0, wa, a0);
        b0 = vec_fma(v0, wb, b0);
        a1 = vec_fma(v1, wa, a1);
        b1 = vec_fma(v1, wb, b1);
        a2 = vec_fma(v2, wa, a2);
        b2 = vec_fma(v2, wb, b2);
        a3 = vec_fma(v3, wa, a3);
        b3 = vec_fma(v3, wb, b3);
    }
    put(t, row, column, a0);
    put(t, row, column + VEC_LANES, b0);
    put(t, row + 1, column, a1);
    put(t, row + 1, column + VEC_LANES, b1);
    put(t, row + 2, column, a2);
    put(t, row + 2, column + VEC_LANES, b2);
    put(t, row + 3, column, a3);
    put(t, row + 3, column + VEC_LANES, b3);
}

static void tile_4x1(const tile *t, size_t row, size_t column)
{
    const real *const x0 = t->x + row * t->x_stride;
    const real *const x1 = x0 + t->x_stride;
    const real *const x2 = x1 + t->x_stride;
    const real *const x3 = x2 + t->x_stride;
    const real *w = t->w + column;
    vec a0 = vec_zero(), a1, a2, a3;
    size_t k;

    if (t->bias)
        a0 = vec_load(t->bias + column);
    a1 = a2 = a3 = a0;
    for (k = 0; k < t->n_in; k++, w += t->stride) {
        const vec wa = vec_load(w);

        a0 = vec_fma(vec_set1(x0[k]), wa, a0);
        a1 = vec_fma(vec_set1(x1[k]), wa, a1);
        a2 = vec_fma(vec_set1(x2[k]), wa, a2);
        a3 = vec_fma(vec_set1(x3[k]), wa, a3);
    }
    put(t, row, column, a0);
    put(t, row + 1, column, a1);
    put(t, row + 2, column, a2);
    put(t, row + 3, column, a3);
}

static void tile_1x1(const tile *t, size_t row, size_t column)
{
    const real *const x = t->x + row * t->x_stride;
    const real *w = t->w + column;
    vec a = t->bias ? vec_load(t->bias + column) : vec_zero();
    size_t k;

    for (k = 0; k < t->n_in; k++, w += t->stride)
        a = vec_fma(vec_set1(x[k]), vec_load(w), a);
    put(t, row, column, a);
}

void saga_dense_forward(real *y, const saga_dense *layer,
                        const saga_dense_rows *x)
{
    const size_t width = saga_dense_pad(layer->n_out);
    const tile t = { x->at, layer->w, layer->bias, y, x->stride, width,
                     x->width, layer->relu };
    size_t row, column;

    for (row = 0; row + 4 <= x->n; row += 4) {
        for (column = 0; column + COLUMNS <= width; column += COLUMNS)
            tile_4x2(&t, row, column);
        if (column < width)
            tile_4x1(&t, row, column);
    }
    for (; row < x->n; row++)
        for (column = 0; column < width; column += VEC_LANES)
            tile_1x1(&t, row, column);
}

/* --- dw += dy^T x -------------------------------------------------------- */

typedef struct {
    real *dw;
    const real *dy, *x;
    size_t dy_stride, stride;  /* stride: of dw and x */
    size_t n;
} outer;

static void add(real *to, vec v)
{
    vec_store(to, vec_load(to) + v);
}

static void outer_4x2(const outer *t, size_t row, size_t column)
{
    const real *dy = t->dy + row;
    const real *x = t->x + column;
    real *const to = t->dw + row * t->stride + column;
    vec a0 = vec_zero(), a1 = a0, a2 = a0, a3 = a0;
    vec b0 = a0, b1 = a0, b2 = a0, b3 = a0;
    size_t i;

    for (i = 0; i < t->n; i++, dy += t->dy_stride, x += t->stride) {
        const vec xa = vec_load(x), xb = vec_load(x + VEC_LANES);
        const vec v0 = vec_set1(dy[0]), v1 = vec_set1(dy[1]);
        const vec v2 = vec_set1(dy[2]), v3 = vec_set1(dy[3]);

        a0 = vec_fma(v0, xa, a0);
        b0 = vec_fma(v0, xb, b0);
        a1 = vec_fma(v1, xa, a1);
        b1 = vec_fma(v1, xb, b1);
        a2 = vec_fma(v2, xa, a2);
        b2 = vec_fma(v2, xb, b2);
        a3 = vec_fma(v3, xa, a3);
        b3 = vec_fma(v3, xb, b3);
    }
    add(to, a0);
    add(to + VEC_LANES, b0);
    add(to + t->stride, a1);
    add(to + t->stride + VEC_LANES, b1);
    add(to + 2 * t->stride, a2);
    add(to + 2 * t->stride + VEC_LANES, b2);
    add(to + 3 * t->stride, a3);
    add(to + 3 * t->stride + VEC_LANES, b3);
}

static void outer_4x1(const outer *t, size_t row, size_t column)
{
    const real *dy = t->dy + row;
    const real *x = t->x + column;
    real *const to = t->dw + row * t->stride + column;
    vec a0 = vec_zero(), a1 = a0, a2 = a0, a3 = a0;
    size_t i;

    for (i = 0; i < t->n; i++, dy += t->dy_stride, x += t->stride) {
        const vec xa = vec_load(x);

        a0 = vec_fma(vec_set1(dy[0]), xa, a0);
        a1 = vec_fma(vec_set1(dy[1]), xa, a1);
        a2 = vec_fma(vec_set1(dy[2]), xa, a2);
        a3 = vec_fma(vec_set1(dy[3]), xa, a3);
    }
    add(to, a0);
    add(to + t->stride, a1);
    add(to + 2 * t->stride, a2);
    add(to + 3 * t->stride, a3);
}

static void outer_1x1(const outer *t, size_t row, size_t column)
{
    const real *dy = t->dy + row;
    const real *x = t->x + column;
    vec a = vec_zero();
    size_t i;

    for (i = 0; i < t->n; i++, dy += t->dy_stride, x += t->stride)
        a = vec_fma(vec_set1(dy[0]), vec_load(x), a);
    add(t->dw + row * t->stride + column, a);
}

static void outer_chunk(const outer *t, size_t n_out)
{
    size_t row, column;

    for (row = 0; row + 4 <= n_out; row += 4) {
        for (column = 0; column + COLUMNS <= t->stride; column += COLUMNS)
            outer_4x2(t, row, column);
        if (column < t->stride)
            outer_4x1(t, row, column);
    }
    for (; row < n_out; row++)
        for (column = 0; column < t->stride; column += VEC_LANES)
            outer_1x1(t, row, column);
}

void saga_dense_backward(real *dw, const saga_dense_rows *dy,
                         const saga_dense_rows *x)
{
    size_t i;

    for (i = 0; i < dy->n; i += CHUNK) {
        const size_t left = dy->n - i;
        const outer t = { dw, dy->at + i * dy->stride, x->at + i * x->stride,
                          dy->stride, x->stride, left < CHUNK ? left : CHUNK };

        outer_chunk(&t, dy->width);
    }
}

void saga_dense_bias_backward(real *db, const saga_dense_rows *dy)
{
    size_t i, o;

    for (i = 0; i < dy->n; i++)
        for (o = 0; o < dy->width; o++)
            db[o] += dy->at[i * dy->stride + o];
}
