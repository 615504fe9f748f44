/* SPDX-License-Identifier: MIT
 *
 * Inner products in plain C, one point after another. Compilers vectorise a
 * reduction over int16 products well (with pmaddwd and similar instructions),
 * so this file is compiled with -O3. Four rows at a time share every load of x,
 * and rows are padded, so that no remainder is left. On x86 and in browsers
 * mlp_x86.h processes eight rows of four points at a time; without SIMD,
 * mlp_pairs.h processes two points at a time. */
#include "mlp.h"

#include "fx.h"

/* 65538 * 32767 = 2^31 - 2 is the largest multiple of 32767 below 2^31, so that
 * after the first tests everything fits int32. */
int saga_mlp_row_is_valid(int64_t weight_abs_sum, int64_t bias, int shift)
{
    const int32_t limit = INT32_MAX;
    int32_t room;

    if (shift < 0 || shift > 24 || bias < -limit || bias > limit)
        return 0;
    if (weight_abs_sum < 0 || weight_abs_sum > 65538)
        return 0;
    room = limit - (int32_t)(bias < 0 ? -bias : bias) - (1 << shift >> 1);
    return (int32_t)weight_abs_sum * 32767 <= room;
}

/* sum[r] = the inner product of x and row r of four; n a multiple of
 * SAGA_MLP_PAD. */
#if (defined __SSE2__ && (defined __clang__ || __GNUC__ >= 12)) || \
    defined __wasm_simd128__
#define INLINE static inline __attribute__((always_inline))
#ifdef __AVX2__
#define SAGA_MLP_AVX2
#endif
#include "mlp_x86.h"
#else
#if UINTPTR_MAX > UINT32_MAX && !defined SAGA_MAY_X4
#include "mlp_pairs.h"
#endif

static void dot4_i16(int32_t sum[4], const int16_t *w, const int16_t *x,
                     uint32_t n)
{
    const int16_t *const w1 = w + n, *const w2 = w1 + n, *const w3 = w2 + n;
    int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0;
    uint32_t k;

    for (k = 0; k < n; k++) {
        s0 += w[k] * x[k];
        s1 += w1[k] * x[k];
        s2 += w2[k] * x[k];
        s3 += w3[k] * x[k];
    }
    sum[0] = s0;
    sum[1] = s1;
    sum[2] = s2;
    sum[3] = s3;
}

#ifndef SAGA_MLP_PAIRED

static void dot4_i8(int32_t sum[4], const int8_t *w, const int16_t *x,
                    uint32_t n)
{
    const int8_t *const w1 = w + n, *const w2 = w1 + n, *const w3 = w2 + n;
    int32_t s0 = 0, s1 = 0, s2 = 0, s3 = 0;
    uint32_t k;

    for (k = 0; k < n; k++) {
        s0 += w[k] * x[k];
        s1 += w1[k] * x[k];
        s2 += w2[k] * x[k];
        s3 += w3[k] * x[k];
    }
    sum[0] = s0;
    sum[1] = s1;
    sum[2] = s2;
    sum[3] = s3;
}

#endif
#endif

static int32_t dot_i16(const int16_t *w, const int16_t *x, uint32_t n)
{
    int32_t sum = 0;
    uint32_t k;

    for (k = 0; k < n; k++)
        sum += w[k] * x[k];
    return sum;
}

void saga_mlp_products(int32_t *sum, const int16_t *w, const int16_t *x,
                       uint32_t n, uint32_t n_row)
{
    uint32_t i = 0;

    for (; i + 4 <= n_row; i += 4)
        dot4_i16(sum + i, w + i * n, x, n);
    for (; i < n_row; i++)
        sum[i] = dot_i16(w + i * n, x, n);
}

/* Number of rows whose sums are converted together. A larger number makes the
 * vectorised loop over them faster (16 rows: 25 GMAC/s, 64 rows: 31); 64 take
 * 256 bytes of stack. */
#ifdef SAGA_MLP_PAIRED
#define BLOCK SAGA_MLP_PAIRED
#else
#define BLOCK 64u
#endif

/* Computes y = relu?(sat16(fx_rshift(bias + sum, shift))), without branches,
 * because the sign of a hidden activation is unpredictable. For a shift of 0
 * the rounding term (1 << 0) >> 1 is 0. */
static void finish(int16_t *restrict y, const saga_layer *layer,
                   const int32_t *sum, uint32_t row, uint32_t n)
{
    const int32_t *const bias = layer->bias + row;
    const uint8_t *const shift = layer->shift + row;
    const int32_t keep = layer->relu ? 0 : -1;
    uint32_t i;

    for (i = 0; i < n; i++) {
        const int32_t half = 1 << shift[i] >> 1;
        const int32_t v = (bias[i] + sum[i] + half) >> shift[i];

        FX_ASSERT(shift[i] <= 24);
        y[row + i] = fx_sat16(v & (keep | ~(v >> 31)));
    }
}

#ifdef SAGA_MLP_PAIRED

/* Computes at most BLOCK rows from `row` on, two points at a time. */
static void run_rows(int16_t *y, const saga_layer *layer, const int16_t *x,
                     uint32_t row, uint32_t n)
{
    const uint32_t stride = saga_mlp_pad(layer->n_out);
    const uint32_t left = layer->n_out - row;
    saga_pairs p;

    p.n_row = left < BLOCK ? left : BLOCK;
    for (; n >= 2; n -= 2, x += 2 * saga_mlp_pad(layer->n_in)) {
        sum_pairs(&p, layer, x, row, 2);
        finish(y, layer, p.sum[0], row, p.n_row);
        y += stride;
        finish(y, layer, p.sum[1], row, p.n_row);
        y += stride;
    }
    if (n == 0)
        return;
    sum_pairs(&p, layer, x, row, 1);
    finish(y, layer, p.sum[0], row, p.n_row);
}

#else

static void dot_rows_i16(int32_t *sum, const saga_layer *layer,
                         const int16_t *x, uint32_t row, uint32_t n_row)
{
    const uint32_t n = saga_mlp_pad(layer->n_in);
    const int16_t *const w = layer->weight;

    saga_mlp_products(sum, w + row * n, x, n, n_row);
}

static int32_t dot_i8(const int8_t *w, const int16_t *x, uint32_t n)
{
    int32_t sum = 0;
    uint32_t k;

    for (k = 0; k < n; k++)
        sum += w[k] * x[k];
    return sum;
}

static void dot_rows_i8(int32_t *sum, const saga_layer *layer, const int16_t *x,
                        uint32_t row, uint32_t n_row)
{
    const uint32_t n = saga_mlp_pad(layer->n_in);
    const int8_t *w = layer->weight;
    uint32_t i = 0;

    w += row * n;
    for (; i + 4 <= n_row; i += 4)
        dot4_i8(sum + i, w + i * n, x, n);
    for (; i < n_row; i++)
        sum[i] = dot_i8(w + i * n, x, n);
}

/* Computes at most BLOCK consecutive rows from `row` on. */
static void run_rows(int16_t *y, const saga_layer *layer, const int16_t *x,
                     uint32_t row, uint32_t n)
{
    const uint32_t left = layer->n_out - row;
    const uint32_t n_row = left < BLOCK ? left : BLOCK;
    int32_t sum[BLOCK];

    for (; n > 0; n--, x += saga_mlp_pad(layer->n_in)) {
        if (layer->int8)
            dot_rows_i8(sum, layer, x, row, n_row);
        else
            dot_rows_i16(sum, layer, x, row, n_row);
        finish(y, layer, sum, row, n_row);
        y += saga_mlp_pad(layer->n_out);
    }
}

#endif

void saga_mlp_layer(int16_t *y, const saga_layer *layer, const int16_t *x,
                    uint32_t n)
{
    const uint32_t n_row = layer->n_out;
    uint32_t row = 0, done = 0; /* points of which all rows are computed */

#ifdef SAGA_MLP_TILE
#ifdef SAGA_MLP_MAY_AVX2
    row = layer->cpu >= SAGA_CPU_AVX2 ? saga_mlp_tiles__avx2(y, layer, x, n)
                                      : run_tiles(y, layer, x, n);
#else
    row = run_tiles(y, layer, x, n);
#endif
    if (row < n_row)
        done = run_rest(y, layer, x, row, n);
#endif
    x += done * saga_mlp_pad(layer->n_in);
    y += done * saga_mlp_pad(layer->n_out);
    for (; row < n_row && done < n; row += BLOCK)
        run_rows(y, layer, x, row, n - done);
#ifdef SAGA_COUNT_MACS
    saga_count_macs((uint64_t)n * layer->n_in * n_row);
#endif
}

/* A tile has the shape (pad(n_in) / 2, 8, 2): for each pair of inputs, the
 * pairs of weights of eight rows. Rows after the last tile, or all rows if
 * there are no tiles, are stored one after another. */
size_t saga_mlp_weight_at(uint32_t n_in, uint32_t n_out, uint32_t row,
                          uint32_t k)
{
    const size_t n = saga_mlp_pad(n_in);

#ifdef SAGA_MLP_TILE
    const uint32_t in_tile = row % SAGA_MLP_TILE, first = row - in_tile;

    if (first + SAGA_MLP_TILE <= n_out)
        return first * n + k / 2 * (2 * SAGA_MLP_TILE) + 2 * in_tile + k % 2;
#else
    (void)n_out;
#endif
    return row * n + k;
}
