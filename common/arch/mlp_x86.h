/* SPDX-License-Identifier: MIT
 *
 * Inner products with the instruction pmaddwd of x86, which WebAssembly SIMD
 * has too. mlp.c includes this file if SSE2 or simd128 is available; the
 * results are those of its plain loops, bit for bit.
 *
 * Compilers use pmaddwd by themselves, but then add up the lanes of each row
 * separately and convert sums to results one at a time. For rows of 16 to 64
 * inputs this takes longer than the products. Here the weights of a layer are
 * stored in tiles of eight rows. A pair of activations, repeated in all lanes,
 * is multiplied by the pairs of weights of eight rows (four without AVX2).
 * Each lane sums one row, and all sums are converted together. The inner
 * products of the memory bank, and of rows after the last tile, are computed
 * four rows at a time.
 *
 * pmaddwd adds two products. Only 2 (-32768)^2 would overflow, and neither
 * weights nor activations reach -32768. Compiler builtins are used because
 * immintrin.h needs a C library.
 *
 * The including file defines INLINE, the way in which functions are inlined,
 * and SAGA_MLP_AVX2 if it is compiled for AVX2.
 */
#ifndef SAGA_MLP_X86_H
#define SAGA_MLP_X86_H

#include "mlp_layer.h"

#include <stddef.h>
#include <stdint.h>

#ifdef INLINE

/* The number of rows in a tile, whose sums are one vector with AVX2 and two
 * without, and the number of points that share each load of weights. */
#define SAGA_MLP_TILE 8u
#define SAGA_MLP_POINTS 4u

typedef int16_t saga_i16x8 __attribute__((vector_size(16)));
typedef int32_t saga_i32x4 __attribute__((vector_size(16)));

#ifdef SAGA_MLP_AVX2

enum { LANES = 16, TILE_VECTORS = 1 };
typedef int32_t saga_sums __attribute__((vector_size(32)));
typedef int16_t saga_words __attribute__((vector_size(32)));
typedef saga_sums saga_shifts;

INLINE saga_sums products(saga_words w, saga_words x)
{
    return (saga_sums)__builtin_ia32_pmaddwd256(w, x);
}

/* With __builtin_convertvector gcc 12 converts each half on its own, so that it
 * needs builtins of x86, which clang does not have. */
#ifdef __clang__

INLINE saga_words load_i8(const int8_t *p)
{
    typedef int8_t bytes __attribute__((vector_size(16)));
    bytes b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_convertvector(b, saga_words);
}

INLINE saga_sums load_shifts(const uint8_t *p)
{
    typedef uint8_t bytes __attribute__((vector_size(8)));
    bytes b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_convertvector(b, saga_sums);
}

#else

typedef char saga_chars __attribute__((vector_size(16)));

INLINE saga_words load_i8(const int8_t *p)
{
    saga_chars b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_ia32_pmovsxbw256(b);
}

INLINE saga_sums load_shifts(const uint8_t *p)
{
    typedef int64_t whole __attribute__((vector_size(16)));
    int64_t b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_ia32_pmovzxbd256((saga_chars)(whole){ b, 0 });
}

#endif

/* Returns 2^(shift - 1), or 0 for a shift of 0. */
INLINE saga_sums half_of(saga_sums shift)
{
    const saga_sums zero = { 0 };

    return (zero + 1) << shift >> 1;
}

INLINE saga_sums rshift_each(saga_sums v, saga_sums shift)
{
    return v >> shift;
}

/* Returns, in each half of the vector, a0 + a2, b0 + b2, a1 + a3, b1 + b3,
 * where a0..a3 and b0..b3 are the lanes of that half. */
INLINE saga_sums fold2(saga_sums a, saga_sums b)
{
    return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13) +
           __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}

/* Returns the sums of all lanes of a, b, c and d, from fold2(a, b) and
 * fold2(c, d). */
INLINE saga_i32x4 fold4(saga_sums ab, saga_sums cd)
{
    const saga_sums s =
        __builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13) +
        __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15);

    return __builtin_shufflevector(s, s, 0, 1, 2, 3) +
           __builtin_shufflevector(s, s, 4, 5, 6, 7);
}

#else

enum { LANES = 8, TILE_VECTORS = 2 };
typedef saga_i32x4 saga_sums;
typedef saga_i16x8 saga_words;

#ifdef __wasm_simd128__

INLINE saga_sums products(saga_words w, saga_words x)
{
    return (saga_sums)__builtin_wasm_dot_s_i32x4_i16x8(w, x);
}

#else

INLINE saga_sums products(saga_words w, saga_words x)
{
    return (saga_sums)__builtin_ia32_pmaddwd128(w, x);
}

#endif

/* Places each byte in the upper half of a word, then shifts it down, which
 * extends its sign. */
INLINE saga_words load_i8(const int8_t *p)
{
    typedef int8_t bytes __attribute__((vector_size(16)));
    typedef int64_t whole __attribute__((vector_size(16)));
    const bytes zero = { 0 };
    int64_t b;

    __builtin_memcpy(&b, p, sizeof b);
    return (saga_words)__builtin_shufflevector(zero, (bytes)(whole){ b, 0 }, 0,
                                               16, 1, 17, 2, 18, 3, 19, 4, 20,
                                               5, 21, 6, 22, 7, 23) >>
           8;
}

/* SSE2 and simd128 shift all lanes by the same number. Therefore a vector is
 * shifted once by each lane's number, and lane i is taken from the i-th result.
 */
typedef struct {
    int32_t by[4];
} saga_shifts;

INLINE saga_shifts load_shifts(const uint8_t *p)
{
    const saga_shifts n = { { p[0], p[1], p[2], p[3] } };

    return n;
}

INLINE saga_sums diagonal(saga_sums a, saga_sums b, saga_sums c, saga_sums d)
{
    return __builtin_shufflevector(__builtin_shufflevector(a, b, 0, 0, 5, 5),
                                   __builtin_shufflevector(c, d, 2, 2, 7, 7), 0,
                                   2, 4, 6);
}

INLINE saga_sums half_of(saga_shifts n)
{
    const saga_sums one = { 1, 1, 1, 1 };

    return diagonal(one << n.by[0], one << n.by[1], one << n.by[2],
                    one << n.by[3]) >>
           1;
}

INLINE saga_sums rshift_each(saga_sums v, saga_shifts n)
{
    return diagonal(v >> n.by[0], v >> n.by[1], v >> n.by[2], v >> n.by[3]);
}

INLINE saga_sums fold2(saga_sums a, saga_sums b)
{
    return __builtin_shufflevector(a, b, 0, 4, 1, 5) +
           __builtin_shufflevector(a, b, 2, 6, 3, 7);
}

INLINE saga_i32x4 fold4(saga_sums ab, saga_sums cd)
{
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
           __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

#endif

/* Converts eight lanes to 16 bits with saturation; the lanes of low come first.
 */
INLINE saga_i16x8 pack(saga_i32x4 low, saga_i32x4 high)
{
#ifdef __wasm_simd128__
    return (saga_i16x8)__builtin_wasm_narrow_s_i16x8_i32x4(low, high);
#else
    return (saga_i16x8)__builtin_ia32_packssdw128(low, high);
#endif
}

INLINE saga_words load_i16(const int16_t *p)
{
    saga_words w;

    __builtin_memcpy(&w, p, sizeof w);
    return w;
}

INLINE void store_sums(int32_t sum[4], saga_sums a, saga_sums b, saga_sums c,
                       saga_sums d)
{
    const saga_i32x4 s = fold4(fold2(a, b), fold2(c, d));

    __builtin_memcpy(sum, &s, sizeof s);
}

/* Compute the inner products of x and four consecutive rows of n weights, as
 * the functions of the same names in mlp.c do. */
INLINE void dot4_i16(int32_t sum[4], const int16_t *w, const int16_t *x,
                     uint32_t n)
{
    const int16_t *const w1 = w + n, *const w2 = w1 + n, *const w3 = w2 + n;
    saga_sums s0 = { 0 }, s1 = { 0 }, s2 = { 0 }, s3 = { 0 };
    uint32_t k;

    for (k = 0; k < n; k += LANES) {
        const saga_words v = load_i16(x + k);

        s0 += products(load_i16(w + k), v);
        s1 += products(load_i16(w1 + k), v);
        s2 += products(load_i16(w2 + k), v);
        s3 += products(load_i16(w3 + k), v);
    }
    store_sums(sum, s0, s1, s2, s3);
}

INLINE void dot4_i8(int32_t sum[4], const int8_t *w, const int16_t *x,
                    uint32_t n)
{
    const int8_t *const w1 = w + n, *const w2 = w1 + n, *const w3 = w2 + n;
    saga_sums s0 = { 0 }, s1 = { 0 }, s2 = { 0 }, s3 = { 0 };
    uint32_t k;

    for (k = 0; k < n; k += LANES) {
        const saga_words v = load_i16(x + k);

        s0 += products(load_i8(w + k), v);
        s1 += products(load_i8(w1 + k), v);
        s2 += products(load_i8(w2 + k), v);
        s3 += products(load_i8(w3 + k), v);
    }
    store_sums(sum, s0, s1, s2, s3);
}

/* --- Tiles --------------------------------------------------------------- */

/* Loads LANES weights from w[at]. The weights are aligned, so that SSE2 can
 * multiply from memory. */
INLINE saga_words load(const void *w, size_t at, int int8)
{
    if (int8)
        return load_i8((const int8_t *)w + at);
    return load_i16(__builtin_assume_aligned((const int16_t *)w + at, 16));
}

/* Returns the pair of activations x[0], x[1], repeated in all lanes. */
INLINE saga_words pair(const int16_t *x)
{
    const saga_sums zero = { 0 };
    int32_t v;

    __builtin_memcpy(&v, x, sizeof v);
    return (saga_words)(zero + v);
}

/* The rows that are summed together: two vectors of rows, which are one tile
 * without AVX2 and two tiles with it, or one vector for the last tile. */
typedef struct {
    const void *weight;
    size_t apart; /* distance between the vectors, in weights */
    int int8;
    uint32_t vectors;
} summed;

/* Sets sum[p] to the sums of the rows for point p, 0..points-1, over n inputs
 * and the padding after them. The function is inlined with constant values of
 * `points` and r->vectors, so that the sums stay in registers. It is unrolled
 * for a single point only, because gcc runs out of registers otherwise. */
INLINE void sum_tile(saga_sums sum[][2], const summed *r, const int16_t *x,
                     uint32_t stride, uint32_t n, uint32_t points)
{
    const uint32_t step = points > 1 ? 2 : 8;
    const saga_sums zero = { 0 };
    uint32_t k, j, p, i;
    size_t at = 0;

    for (p = 0; p < points; p++)
        for (i = 0; i < r->vectors; i++)
            sum[p][i] = zero;
    for (k = 0; k < n; k += step)
        for (j = 0; j < step; j += 2, at += TILE_VECTORS * LANES) {
            saga_words rows[2];

            for (i = 0; i < r->vectors; i++)
                rows[i] = load(r->weight, at + i * r->apart, r->int8);
            for (p = 0; p < points; p++) {
                const saga_words v = pair(x + p * stride + k + j);

                for (i = 0; i < r->vectors; i++)
                    sum[p][i] += products(rows[i], v);
            }
        }
}

/* The constants that convert sums to results. */
typedef struct {
    saga_sums add[2]; /* bias + 2^(shift - 1), for rounding */
    saga_shifts shift[2];
    saga_sums keep; /* all ones without ReLU, else 0 */
} ending;

INLINE void begin_ending(ending *e, const saga_layer *layer, uint32_t row,
                         uint32_t vectors)
{
    const saga_sums zero = { 0 };
    uint32_t i;

    for (i = 0; i < vectors; i++) {
        const uint32_t at = row + i * LANES / 2;

        e->shift[i] = load_shifts(layer->shift + at);
        __builtin_memcpy(&e->add[i], layer->bias + at, sizeof e->add[i]);
        e->add[i] += half_of(e->shift[i]);
    }
    e->keep = zero - !layer->relu;
}

/* Stores eight results. Packing saturates at -32768, which is corrected to
 * -32767. */
INLINE void store_results(int16_t *y, saga_i32x4 low, saga_i32x4 high)
{
    saga_i16x8 out = pack(low, high);

    out -= (saga_i16x8)(out == -32768);
    __builtin_memcpy(y, &out, sizeof out);
}

/* Stores relu?(sat16(fx_rshift(bias + sum, shift))) of each row. */
INLINE void finish_tile(int16_t *y, const ending *e, const saga_sums sum[2],
                        uint32_t vectors)
{
    saga_sums v[2];
    uint32_t i;

    for (i = 0; i < vectors; i++) {
        v[i] = rshift_each(sum[i] + e->add[i], e->shift[i]);
        v[i] &= e->keep | ~(v[i] >> 31);
    }
#ifdef SAGA_MLP_AVX2
    for (i = 0; i < vectors; i++)
        store_results(y + i * SAGA_MLP_TILE,
                      __builtin_shufflevector(v[i], v[i], 0, 1, 2, 3),
                      __builtin_shufflevector(v[i], v[i], 4, 5, 6, 7));
#else
    store_results(y, v[0], v[1]);
#endif
}

/* Computes the outputs of the rows r, which begin with number `row`, for n
 * points. Each load of weights serves SAGA_MLP_POINTS points, and each load of
 * a pair of activations serves all vectors of rows. */
INLINE void run_tile(int16_t *y, const saga_layer *layer, const summed *r,
                     const int16_t *x, uint32_t row, uint32_t n)
{
    const uint32_t stride = saga_mlp_pad(layer->n_in);
    const uint32_t y_stride = saga_mlp_pad(layer->n_out);
    saga_sums sum[SAGA_MLP_POINTS][2];
    ending end;
    uint32_t p;

    begin_ending(&end, layer, row, r->vectors);
    y += row;
    for (; n >= SAGA_MLP_POINTS; n -= SAGA_MLP_POINTS) {
        sum_tile(sum, r, x, stride, layer->n_in, SAGA_MLP_POINTS);
        for (p = 0; p < SAGA_MLP_POINTS; p++)
            finish_tile(y + p * y_stride, &end, sum[p], r->vectors);
        x += SAGA_MLP_POINTS * stride;
        y += SAGA_MLP_POINTS * y_stride;
    }
    for (; n > 0; n--, x += stride, y += y_stride) {
        sum_tile(sum, r, x, stride, layer->n_in, 1);
        finish_tile(y, &end, sum[0], r->vectors);
    }
}

/* Does the work of run_tiles; `int8` is a constant after inlining. */
INLINE uint32_t run_all(int16_t *y, const saga_layer *layer, const int16_t *x,
                        uint32_t n, int int8)
{
    const size_t stride = saga_mlp_pad(layer->n_in);
    const size_t apart = TILE_VECTORS == 2 ? LANES : SAGA_MLP_TILE * stride;
    const uint32_t step = 2 / TILE_VECTORS * SAGA_MLP_TILE;
    const char *const w = layer->weight;
    const size_t row_nbytes = stride * (int8 ? 1 : 2);
    uint32_t row = 0;

    for (; row + step <= layer->n_out; row += step) {
        const summed r = { w + row * row_nbytes, apart, int8, 2 };

        run_tile(y, layer, &r, x, row, n);
    }
    if (TILE_VECTORS == 1 && row + SAGA_MLP_TILE <= layer->n_out) {
        const summed r = { w + row * row_nbytes, apart, int8, 1 };

        run_tile(y, layer, &r, x, row, n);
        row += SAGA_MLP_TILE;
    }
    return row;
}

/* Computes the rows of all whole tiles for n points. Returns the number of
 * these rows. */
INLINE uint32_t run_tiles(int16_t *y, const saga_layer *layer, const int16_t *x,
                          uint32_t n)
{
    return layer->int8 ? run_all(y, layer, x, n, 1)
                       : run_all(y, layer, x, n, 0);
}

/* --- Rows after the last tile -------------------------------------------- */

/* Stores relu?(sat16(fx_rshift(bias + sum, shift))) of one row for four points.
 * The lanes of `sum` are points, so that all are shifted by one number. */
INLINE void finish_points(int16_t *y, uint32_t y_stride,
                          const saga_layer *layer, uint32_t row, saga_i32x4 sum)
{
    const int shift = layer->shift[row];
    const saga_i32x4 v = (sum + (layer->bias[row] + (1 << shift >> 1))) >>
                         shift;
    int16_t out[8];
    uint32_t p;

    store_results(out, layer->relu ? v & ~(v >> 31) : v, v);
    for (p = 0; p < 4; p++)
        y[p * y_stride + row] = out[p];
}

INLINE saga_i32x4 dot_points(const saga_layer *layer, const int16_t *x,
                             uint32_t row, int int8)
{
    const uint32_t n = saga_mlp_pad(layer->n_in);
    const int8_t *const w8 = layer->weight;
    const int16_t *const w16 = layer->weight;
    saga_sums s[4] = { { 0 } };
    uint32_t k, p;

    for (k = 0; k < n; k += LANES) {
        const saga_words w = int8 ? load_i8(w8 + row * n + k)
                                  : load_i16(w16 + row * n + k);

        for (p = 0; p < 4; p++)
            s[p] += products(w, load_i16(x + p * n + k));
    }
    return fold4(fold2(s[0], s[1]), fold2(s[2], s[3]));
}

/* Computes the rows from `row` on, four points at a time. Returns the number of
 * points that this is done for, of n. */
INLINE uint32_t run_rest(int16_t *y, const saga_layer *layer, const int16_t *x,
                         uint32_t row, uint32_t n)
{
    const uint32_t stride = saga_mlp_pad(layer->n_in);
    const uint32_t y_stride = saga_mlp_pad(layer->n_out);
    uint32_t p, i;

    for (p = 0; p + 4 <= n; p += 4, x += 4 * stride, y += 4 * y_stride)
        for (i = row; i < layer->n_out; i++)
            finish_points(y, y_stride, layer, i,
                          layer->int8 ? dot_points(layer, x, i, 1)
                                      : dot_points(layer, x, i, 0));
    return p;
}

#endif
#endif
