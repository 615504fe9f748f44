/* SPDX-License-Identifier: MIT
 *
 * Tiles have 16 columns and as many rows as give eight accumulators, since a
 * processor that starts two fused multiply-adds in a cycle and finishes each in
 * four needs eight: 8 rows in AVX-512, 4 in AVX2. The order of each sum is the
 * same in both, so results have the same bits.
 */
#include "dense.h"

#include "wide.h"

/* Rows of a tile. A row is one register, or two in AVX2. */
#if defined __AVX512F__ && !defined SAGA_REAL_DOUBLE
enum { ROWS = 8 };
#else
enum { ROWS = 4 };
#endif

enum { NARROW = 8, CHUNK = 64 };

static vec rectify(vec x)
{
    return vec_max(x, vec_zero());
}

/* --- y = x w ------------------------------------------------------------- */

/* The place of a tile, and its surroundings. */
typedef struct {
    const real *x, *w, *bias, *active;
    real *y;
    size_t x_stride, stride; /* stride: of y, w and active */
    size_t n_in;
    int relu;
} tile;

static void put(const tile *t, size_t row, size_t column, vec v)
{
    const size_t at = row * t->stride + column;

    if (t->relu)
        v = rectify(v);
    if (t->active)
        v = vec_and((veci)(vec_load(t->active + at) > vec_zero()), v);
    vec_store(t->y + at, v);
}

static void put_wide(const tile *t, size_t row, size_t column, wide v)
{
    const size_t at = row * t->stride + column;

    if (t->relu)
        v = wide_max(v, wide_zero());
    if (t->active)
        v = wide_keep(wide_less(wide_zero(), wide_load(t->active + at)), v);
    wide_store(t->y + at, v);
}

static void tile_wide(const tile *t, size_t row, size_t column)
{
    const real *const x = t->x + row * t->x_stride;
    const real *w = t->w + column;
    wide a[ROWS];
    size_t k;
    int i;

    WIDE_UNROLL
    for (i = 0; i < ROWS; i++)
        a[i] = t->bias ? wide_load(t->bias + column) : wide_zero();
    /* Sixteen weights are loaded once for ROWS points. Each sum starts with the
     * bias and adds the inputs in order, as in the smaller tiles. */
    for (k = 0; k < t->n_in; k++, w += t->stride) {
        const wide at = wide_load(w);

        WIDE_UNROLL
        for (i = 0; i < ROWS; i++)
            a[i] = wide_fma(wide_set1(x[(size_t)i * t->x_stride + k]), at,
                            a[i]);
    }
    WIDE_UNROLL
    for (i = 0; i < ROWS; i++)
        put_wide(t, row + (size_t)i, column, a[i]);
}

/* A tile of one vector, with as many points as need eight accumulators. */
static void tile_narrow(const tile *t, size_t row, size_t column)
{
    const real *const x = t->x + row * t->x_stride;
    const real *w = t->w + column;
    vec a[NARROW];
    size_t k;
    int i;

    WIDE_UNROLL
    for (i = 0; i < NARROW; i++)
        a[i] = t->bias ? vec_load(t->bias + column) : vec_zero();
    for (k = 0; k < t->n_in; k++, w += t->stride) {
        const vec at = vec_load(w);

        WIDE_UNROLL
        for (i = 0; i < NARROW; i++)
            a[i] = vec_fma(vec_set1(x[(size_t)i * t->x_stride + k]), at, a[i]);
    }
    WIDE_UNROLL
    for (i = 0; i < NARROW; i++)
        put(t, row + (size_t)i, column, a[i]);
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
    const tile t = { .x = x->at,
                     .w = layer->w,
                     .bias = layer->bias,
                     .active = layer->active,
                     .y = y,
                     .x_stride = x->stride,
                     .stride = width,
                     .n_in = x->width,
                     .relu = layer->relu };
    size_t row, column, i;

    /* Whole tiles come first, next to them the columns that do not fill a tile,
     * and then the remaining points one by one. */
    for (row = 0; row + NARROW <= x->n; row += NARROW) {
        for (column = 0; column + WIDE_LANES <= width; column += WIDE_LANES)
            for (i = 0; i < NARROW; i += ROWS)
                tile_wide(&t, row + i, column);
        for (; column < width; column += VEC_LANES)
            tile_narrow(&t, row, column);
    }
    for (; row < x->n; row++)
        for (column = 0; column < width; column += VEC_LANES)
            tile_1x1(&t, row, column);
}

/* --- dw += dy^T x -------------------------------------------------------- */

typedef struct {
    real *dw;
    const real *dy, *x;
    size_t dy_stride, stride; /* stride: of dw and x */
    size_t n;
} outer;

static void add(real *to, vec v)
{
    vec_store(to, vec_load(to) + v);
}

static void outer_wide(const outer *t, size_t row, size_t column)
{
    const real *dy = t->dy + row;
    const real *x = t->x + column;
    real *const to = t->dw + row * t->stride + column;
    wide a[ROWS];
    size_t n;
    int i;

    WIDE_UNROLL
    for (i = 0; i < ROWS; i++)
        a[i] = wide_zero();
    /* A chunk is summed in registers, from 0, and added to dw once. */
    for (n = 0; n < t->n; n++, dy += t->dy_stride, x += t->stride) {
        const wide at = wide_load(x);

        WIDE_UNROLL
        for (i = 0; i < ROWS; i++)
            a[i] = wide_fma(wide_set1(dy[i]), at, a[i]);
    }
    WIDE_UNROLL
    for (i = 0; i < ROWS; i++) {
        real *const sum = to + (size_t)i * t->stride;

        wide_store(sum, wide_add(wide_load(sum), a[i]));
    }
}

/* A tile of n rows and n_vecs vectors. Rows after the first n_kept are of no
 * use: they repeat the first one and are not stored. */
static inline void outer_rows(const outer *t, size_t row, size_t column,
                              int n_rows, int n_vecs, int n_kept)
{
    const real *dy = t->dy + row;
    const real *x = t->x + column;
    real *const to = t->dw + row * t->stride + column;
    vec a[NARROW];
    size_t point;
    int i, k;

    WIDE_UNROLL
    for (i = 0; i < NARROW; i++)
        a[i] = vec_zero();
    for (point = 0; point < t->n; point++, dy += t->dy_stride, x += t->stride) {
        WIDE_UNROLL
        for (k = 0; k < n_vecs; k++) {
            const vec at = vec_load(x + k * VEC_LANES);

            WIDE_UNROLL
            for (i = 0; i < n_rows; i++)
                a[k * n_rows + i] = vec_fma(vec_set1(dy[i < n_kept ? i : 0]),
                                            at, a[k * n_rows + i]);
        }
    }
    WIDE_UNROLL
    for (k = 0; k < n_vecs; k++) {
        WIDE_UNROLL
        for (i = 0; i < n_rows; i++)
            if (i < n_kept)
                add(to + (size_t)i * t->stride + k * VEC_LANES,
                    a[k * n_rows + i]);
    }
}

/* Rows that are too few for tiles of eight, in tiles of four. */
static void outer_rest(const outer *t, size_t row, size_t n_out)
{
    for (; row < n_out; row += 4) {
        const int kept = n_out - row < 4 ? (int)(n_out - row) : 4;
        size_t column = 0;

        for (; column + 2 * VEC_LANES <= t->stride; column += 2 * VEC_LANES)
            outer_rows(t, row, column, 4, 2, kept);
        for (; column < t->stride; column += VEC_LANES)
            outer_rows(t, row, column, 4, 1, kept);
    }
}

static void outer_chunk(const outer *t, size_t n_out)
{
    size_t row, column, i;

    /* dw has a row for each output: tiles of eight rows come first. */
    for (row = 0; row + NARROW <= n_out; row += NARROW) {
        for (column = 0; column + WIDE_LANES <= t->stride; column += WIDE_LANES)
            for (i = 0; i < NARROW; i += ROWS)
                outer_wide(t, row + i, column);
        for (; column < t->stride; column += VEC_LANES)
            outer_rows(t, row, column, NARROW, 1, NARROW);
    }
    outer_rest(t, row, n_out);
}

void saga_dense_backward(real *dw, const saga_dense_rows *dy,
                         const saga_dense_rows *x)
{
    size_t i;

    for (i = 0; i < dy->n; i += CHUNK) {
        /* Chunks are the same in every build, so sums have the same order. */
        const size_t left = dy->n - i;
        const outer t = { dw,
                          dy->at + i * dy->stride,
                          x->at + i * x->stride,
                          dy->stride,
                          x->stride,
                          left < CHUNK ? left : CHUNK };

        outer_chunk(&t, dy->width);
    }
}

/* Adds the points' gradients of n_vecs vectors of outputs. */
static inline void bias_vecs(real *db, const saga_dense_rows *dy, size_t o,
                             int n_vecs)
{
    const real *d = dy->at + o;
    vec sum[4];
    size_t i;
    int k;

    WIDE_UNROLL
    for (k = 0; k < n_vecs; k++)
        sum[k] = vec_load(db + o + k * VEC_LANES);
    for (i = 0; i < dy->n; i++, d += dy->stride) {
        WIDE_UNROLL
        for (k = 0; k < n_vecs; k++)
            sum[k] += vec_load(d + k * VEC_LANES);
    }
    WIDE_UNROLL
    for (k = 0; k < n_vecs; k++)
        vec_store(db + o + k * VEC_LANES, sum[k]);
}

void saga_dense_bias_backward(real *db, const saga_dense_rows *dy)
{
    size_t i, k, o = 0;

    /* Several sums go on together, since a sum alone would wait for each of its
     * additions. */
    for (; o + 4 * VEC_LANES <= dy->width; o += 4 * VEC_LANES)
        bias_vecs(db, dy, o, 4);
    for (; o + 2 * VEC_LANES <= dy->width; o += 2 * VEC_LANES)
        bias_vecs(db, dy, o, 2);
    for (; o + VEC_LANES <= dy->width; o += VEC_LANES)
        bias_vecs(db, dy, o, 1);
    for (i = 0; i < dy->n; i++)
        for (k = o; k < dy->width; k++)
            db[k] += dy->at[i * dy->stride + k];
}

SAGA_ISA_CHOOSE(saga_dense_forward);
SAGA_ISA_CHOOSE(saga_dense_backward);
SAGA_ISA_CHOOSE(saga_dense_bias_backward);
