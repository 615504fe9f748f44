/* SPDX-License-Identifier: MIT
 *
 * Four rows of inner products with x86's pmaddwd: the twin of mlp.c's plain
 * loops, bit for bit. Compilers find the instruction by themselves, but then
 * add each row's lanes up on its own, which takes longer than the products of
 * a row of 16 to 64; here four rows are added up together. Included by mlp.c
 * where there is SSE2.
 *
 * pmaddwd adds two products: only 2 (-32768)^2 would overflow, and neither
 * weights nor activations reach -32768. Builtins rather than immintrin.h, which
 * wants a C library.
 */
#ifndef SAGA_MLP_X86_H
#define SAGA_MLP_X86_H

#include <stdint.h>

typedef int32_t saga_i32x4 __attribute__((vector_size(16)));

#ifdef __AVX2__

enum { LANES = 16 };
typedef int32_t saga_sums __attribute__((vector_size(32)));
typedef int16_t saga_words __attribute__((vector_size(32)));

static inline saga_sums products(saga_words w, saga_words x)
{
    return (saga_sums)__builtin_ia32_pmaddwd256(w, x);
}

/* gcc 12 converts in halves, clang has no such builtin. */
static inline saga_words load_i8(const int8_t *p)
{
    typedef int8_t bytes __attribute__((vector_size(16)));
    bytes b;

    __builtin_memcpy(&b, p, sizeof b);
#ifdef __clang__
    return __builtin_convertvector(b, saga_words);
#else
    typedef char chars __attribute__((vector_size(16)));

    return __builtin_ia32_pmovsxbw256((chars)b);
#endif
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
typedef int32_t saga_sums __attribute__((vector_size(16)));
typedef int16_t saga_words __attribute__((vector_size(16)));

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

#endif
