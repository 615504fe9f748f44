/* SPDX-License-Identifier: MIT
 *
 * Inner products with x86's pmaddwd: the twins of mlp.c's plain loops, bit for
 * bit. Included by mlp.c where there is SSE2.
 *
 * Compilers find the instruction by themselves, but then add the lanes of each
 * row up on its own and turn sums into results one at a time, which takes
 * longer than the products of a row of 16 to 64. Here a layer's weights lie in
 * tiles of eight rows: a pair of activations in all lanes meets the pairs of
 * weights of eight rows (four without AVX2), each lane sums a row of its own,
 * and all become results together. Four rows of inner products, for the memory
 * and for what is no tile, are added up together.
 *
 * pmaddwd adds two products: only 2 (-32768)^2 would overflow, and neither
 * weights nor activations reach -32768. Builtins rather than immintrin.h, which
 * wants a C library.
 */
#ifndef SAGA_MLP_X86_H
#define SAGA_MLP_X86_H

#include "mlp.h"

#include <stdint.h>

/* Rows of a tile: a vector of sums with AVX2, two without. */
#define SAGA_MLP_TILE 8u

typedef int16_t saga_i16x8 __attribute__((vector_size(16)));
typedef int32_t saga_i32x4 __attribute__((vector_size(16)));

#ifdef __AVX2__

enum { LANES = 16 };
typedef int32_t saga_sums __attribute__((vector_size(32)));
typedef int16_t saga_words __attribute__((vector_size(32)));

static inline saga_sums products(saga_words w, saga_words x)
{
    return (saga_sums)__builtin_ia32_pmaddwd256(w, x);
}

/* gcc 12 converts in halves, clang has no such builtins. */
#ifdef __clang__

static inline saga_words load_i8(const int8_t *p)
{
    typedef int8_t bytes __attribute__((vector_size(16)));
    bytes b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_convertvector(b, saga_words);
}

static inline saga_sums load_shifts(const uint8_t *p)
{
    typedef uint8_t bytes __attribute__((vector_size(8)));
    bytes b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_convertvector(b, saga_sums);
}

#else

typedef char saga_chars __attribute__((vector_size(16)));

static inline saga_words load_i8(const int8_t *p)
{
    saga_chars b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_ia32_pmovsxbw256(b);
}

static inline saga_sums load_shifts(const uint8_t *p)
{
    typedef int64_t whole __attribute__((vector_size(16)));
    int64_t b;

    __builtin_memcpy(&b, p, sizeof b);
    return __builtin_ia32_pmovzxbd256((saga_chars)(whole){ b, 0 });
}

#endif

static inline saga_sums rshift_each(saga_sums v, const uint8_t *shift)
{
    const saga_sums n = load_shifts(shift), zero = { 0 };

    return (v + ((zero + 1) << n >> 1)) >> n;
}

/* Lanes 0..3 of a and b, in both halves alike: a0 + a2, b0 + b2, a1 + a3, b1 +
 * b3; then of two such. */
static inline saga_sums fold2(saga_sums a, saga_sums b)
{
    return __builtin_shufflevector(a, b, 0, 8, 1, 9, 4, 12, 5, 13) +
           __builtin_shufflevector(a, b, 2, 10, 3, 11, 6, 14, 7, 15);
}

static inline saga_i32x4 fold4(saga_sums ab, saga_sums cd)
{
    const saga_sums s =
        __builtin_shufflevector(ab, cd, 0, 1, 8, 9, 4, 5, 12, 13) +
        __builtin_shufflevector(ab, cd, 2, 3, 10, 11, 6, 7, 14, 15);

    return __builtin_shufflevector(s, s, 0, 1, 2, 3) +
           __builtin_shufflevector(s, s, 4, 5, 6, 7);
}

#else

enum { LANES = 8 };
typedef saga_i32x4 saga_sums;
typedef saga_i16x8 saga_words;

static inline saga_sums products(saga_words w, saga_words x)
{
    return (saga_sums)__builtin_ia32_pmaddwd128(w, x);
}

/* Bytes in the upper halves, then shifted down with their sign. */
static inline saga_words load_i8(const int8_t *p)
{
    typedef int8_t bytes __attribute__((vector_size(16)));
    typedef int64_t whole __attribute__((vector_size(16)));
    const bytes zero = { 0 };
    int64_t b;

    __builtin_memcpy(&b, p, sizeof b);
    return (saga_words)__builtin_shufflevector(
        zero, (bytes)(whole){ b, 0 }, 0, 16, 1, 17, 2, 18, 3, 19, 4, 20, 5, 21,
        6, 22, 7, 23) >> 8;
}

/* SSE2 shifts all lanes by one number: lane i is taken from i's. */
static inline saga_sums diagonal(saga_sums a, saga_sums b, saga_sums c,
                                 saga_sums d)
{
    return __builtin_shufflevector(__builtin_shufflevector(a, b, 0, 0, 5, 5),
                                   __builtin_shufflevector(c, d, 2, 2, 7, 7),
                                   0, 2, 4, 6);
}

static inline saga_sums rshift_each(saga_sums v, const uint8_t *shift)
{
    const saga_sums one = { 1, 1, 1, 1 };

    v += diagonal(one << shift[0], one << shift[1], one << shift[2],
                  one << shift[3]) >> 1;
    return diagonal(v >> shift[0], v >> shift[1], v >> shift[2],
                    v >> shift[3]);
}

static inline saga_sums fold2(saga_sums a, saga_sums b)
{
    return __builtin_shufflevector(a, b, 0, 4, 1, 5) +
           __builtin_shufflevector(a, b, 2, 6, 3, 7);
}

static inline saga_i32x4 fold4(saga_sums ab, saga_sums cd)
{
    return __builtin_shufflevector(ab, cd, 0, 1, 4, 5) +
           __builtin_shufflevector(ab, cd, 2, 3, 6, 7);
}

#endif

static inline saga_words load_i16(const int16_t *p)
{
    saga_words w;

    __builtin_memcpy(&w, p, sizeof w);
    return w;
}

static inline void store_sums(int32_t sum[4], saga_sums a, saga_sums b,
                              saga_sums c, saga_sums d)
{
    const saga_i32x4 s = fold4(fold2(a, b), fold2(c, d));

    __builtin_memcpy(sum, &s, sizeof s);
}

/* As mlp.c's. */
static inline void dot4_i16(int32_t sum[4], const int16_t *w, const int16_t *x,
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

static inline void dot4_i8(int32_t sum[4], const int8_t *w, const int16_t *x,
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

/* LANES weights, aligned so that SSE2 can multiply from memory. */
static inline saga_words load(const void *w, size_t at, int int8)
{
    if (int8)
        return load_i8((const int8_t *)w + at);
    return load_i16(__builtin_assume_aligned((const int16_t *)w + at, 16));
}

/* sum[i] = the sums of rows i * LANES / 2 on of the tile whose weights begin at
 * w[at], over n inputs rounded up to a multiple of 8: every lane meets the same
 * pair of inputs. Two chains of sums, so that neither waits for the other. */
#ifdef __AVX2__

enum { VECTORS = 1 };

static inline saga_words pair(const int16_t *x)
{
    const saga_sums zero = { 0 };
    int32_t v;

    __builtin_memcpy(&v, x, sizeof v);
    return (saga_words)(zero + v);
}

static inline void sum_tile(saga_sums sum[VECTORS], const void *w, size_t at,
                            int int8, const int16_t *x, uint32_t n)
{
    saga_sums a = { 0 }, b = { 0 };
    uint32_t k;

    for (k = 0; k < n; k += 8, at += 64) {
        a += products(load(w, at, int8), pair(x + k));
        b += products(load(w, at + 16, int8), pair(x + k + 2));
        a += products(load(w, at + 32, int8), pair(x + k + 4));
        b += products(load(w, at + 48, int8), pair(x + k + 6));
    }
    sum[0] = a + b;
}

#else

enum { VECTORS = 2 };

static inline void sum_tile(saga_sums sum[VECTORS], const void *w, size_t at,
                            int int8, const int16_t *x, uint32_t n)
{
    saga_sums a = { 0 }, b = { 0 };
    uint32_t k;

    for (k = 0; k < n; k += 8, at += 64) {
        const saga_sums v = (saga_sums)load_i16(x + k);
        const saga_words pair[4] = {
            (saga_words)__builtin_shufflevector(v, v, 0, 0, 0, 0),
            (saga_words)__builtin_shufflevector(v, v, 1, 1, 1, 1),
            (saga_words)__builtin_shufflevector(v, v, 2, 2, 2, 2),
            (saga_words)__builtin_shufflevector(v, v, 3, 3, 3, 3)
        };

        a += products(load(w, at, int8), pair[0]);
        b += products(load(w, at + 8, int8), pair[0]);
        a += products(load(w, at + 16, int8), pair[1]);
        b += products(load(w, at + 24, int8), pair[1]);
        a += products(load(w, at + 32, int8), pair[2]);
        b += products(load(w, at + 40, int8), pair[2]);
        a += products(load(w, at + 48, int8), pair[3]);
        b += products(load(w, at + 56, int8), pair[3]);
    }
    sum[0] = a;
    sum[1] = b;
}

#endif

/* relu?(fx_rshift(bias + sum, shift)), not saturated. */
static inline saga_sums finish_lanes(saga_sums sum, const saga_layer *layer,
                                     uint32_t row)
{
    const saga_sums zero = { 0 };
    saga_sums bias, v;

    __builtin_memcpy(&bias, layer->bias + row, sizeof bias);
    v = rshift_each(bias + sum, layer->shift + row);
    return v & ((zero - !layer->relu) | ~(v >> 31));
}

/* Results of the tile that begins at `row`. Packing saturates at -32768, one
 * too low. */
static inline void run_tile(int16_t *y, const saga_layer *layer,
                            const int16_t *x, uint32_t row)
{
    const size_t at = row * (size_t)saga_mlp_pad(layer->n_in);
    saga_sums sum[VECTORS];
    saga_i32x4 low, high;
    saga_i16x8 out;

    if (layer->int8)
        sum_tile(sum, layer->weight, at, 1, x, layer->n_in);
    else
        sum_tile(sum, layer->weight, at, 0, x, layer->n_in);
    sum[0] = finish_lanes(sum[0], layer, row);
#ifdef __AVX2__
    low = __builtin_shufflevector(sum[0], sum[0], 0, 1, 2, 3);
    high = __builtin_shufflevector(sum[0], sum[0], 4, 5, 6, 7);
#else
    low = sum[0];
    high = finish_lanes(sum[1], layer, row + 4);
#endif
    out = (saga_i16x8)__builtin_ia32_packssdw128(low, high);
    out -= (saga_i16x8)(out == -32768);
    __builtin_memcpy(y + row, &out, sizeof out);
}

#endif
