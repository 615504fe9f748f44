/* SPDX-License-Identifier: MIT
 *
 * Fixed-point arithmetic: the operations of which all normative code is made.
 *
 * A variable carries its Q format in its name: x_q12 holds x * 2^12. There is
 * one rounding in the whole format, fx_rshift: halves go towards +infinity,
 *
 *     fx_rshift(x, n) = (x + 2^(n-1)) >> n   (n >= 1),   fx_rshift(x, 0) = x.
 *
 * The code assumes of the compiler, and asserts below: two's complement,
 * arithmetic right shift of negative values, and conversion to a narrower
 * signed type modulo 2^n. gcc, clang and armcc guarantee these.
 */
#ifndef SAGA_FX_H
#define SAGA_FX_H

#include <stddef.h>
#include <stdint.h>

_Static_assert((-3 >> 1) == -2, "arithmetic shift right");
_Static_assert((int16_t)(uint16_t)0xfffe == -2, "two's complement conversion");
_Static_assert(sizeof(int) >= 4, "int holds 32 bits");

/* Domain checks of each primitive, for tests: build with -DSAGA_CHECK. */
#ifdef SAGA_CHECK
#define FX_ASSERT(c) ((c) ? (void)0 : __builtin_trap())
#else
#define FX_ASSERT(c) ((void)0)
#endif

/* n in 0..31; |x| <= 2^31 - 1 - 2^(n-1). */
static inline int32_t fx_rshift(int32_t x, int n)
{
    FX_ASSERT(n >= 0 && n <= 31);
    if (n == 0)
        return x;
    FX_ASSERT(x <= INT32_MAX - (int32_t)(1u << (n - 1)));
    return (x + (int32_t)(1u << (n - 1))) >> n;
}

/* n in 0..62; |x| <= 2^63 - 1 - 2^(n-1). */
static inline int64_t fx_rshift64(int64_t x, int n)
{
    FX_ASSERT(n >= 0 && n <= 62);
    if (n == 0)
        return x;
    FX_ASSERT(x <= INT64_MAX - ((int64_t)1 << (n - 1)));
    return (x + ((int64_t)1 << (n - 1))) >> n;
}

/* Returns a b / 2^n, computed as a 64-bit product with one rounding. The result
 * must fit in 32 bits. */
static inline int32_t fx_mul_rshift(int32_t a, int32_t b, int n)
{
    return (int32_t)fx_rshift64((int64_t)a * b, n);
}

static inline int32_t fx_clamp(int32_t x, int32_t lo, int32_t hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

static inline int32_t fx_min(int32_t a, int32_t b)
{
    return a < b ? a : b;
}

static inline int32_t fx_max(int32_t a, int32_t b)
{
    return a > b ? a : b;
}

/* Saturation is symmetric, +-32767: a value and its negative both exist. */
static inline int16_t fx_sat16(int32_t x)
{
    return (int16_t)fx_clamp(x, -32767, 32767);
}

static inline int32_t fx_clamp64(int64_t x, int32_t lo, int32_t hi)
{
    return x < lo ? lo : x > hi ? hi : (int32_t)x;
}

static inline int16_t fx_sat16_64(int64_t x)
{
    return (int16_t)fx_clamp64(x, -32767, 32767);
}

/* Converts a 16-bit value from one Q format to another, with saturation; q_from
 * and q_to are in 0..24. */
static inline int16_t fx_requant16(int16_t x, int q_from, int q_to)
{
    if (q_to >= q_from)
        return fx_sat16_64((int64_t)x * ((int64_t)1 << (q_to - q_from)));
    return fx_sat16(fx_rshift(x, q_from - q_to));
}

/* Converts to 32 bits, without saturation. |x| <= 2^15 and q_to - q_from <= 15,
 * so that the magnitude of the result is at most 2^30. */
static inline int32_t fx_requant32(int32_t x, int q_from, int q_to)
{
    FX_ASSERT(x >= -32768 && x <= 32768 && q_to - q_from <= 15);
    if (q_to >= q_from)
        return x * (1 << (q_to - q_from));
    return fx_rshift(x, q_from - q_to);
}

/* Returns the number of leading zeros of x >= 1. It is computed in C where
 * __builtin_clz may be a library call (Thumb-1, rv32i). Where __builtin_clz is
 * an instruction, projection takes a quarter less time with it. */
static inline int fx_clz32(uint32_t x)
{
#if defined __x86_64__ || defined __aarch64__
    FX_ASSERT(x != 0);
    return __builtin_clz(x);
#else
    int n = 0;

    FX_ASSERT(x != 0);
    if (x < 1u << 16) {
        n += 16;
        x <<= 16;
    }
    if (x < 1u << 24) {
        n += 8;
        x <<= 8;
    }
    if (x < 1u << 28) {
        n += 4;
        x <<= 4;
    }
    if (x < 1u << 30) {
        n += 2;
        x <<= 2;
    }
    return x < 1u << 31 ? n + 1 : n;
#endif
}

static inline int fx_clz64(uint64_t x)
{
#if defined __x86_64__ || defined __aarch64__
    FX_ASSERT(x != 0);
    return __builtin_clzll(x);
#else
    const uint32_t hi = (uint32_t)(x >> 32);

    return hi ? fx_clz32(hi) : 32 + fx_clz32((uint32_t)x);
#endif
}

/* Load and store little-endian integers, on machines of either byte order. */
static inline uint32_t fx_load16_le(const uint8_t *p)
{
    return (uint32_t)p[0] | (uint32_t)p[1] << 8;
}

static inline uint32_t fx_load32_le(const uint8_t *p)
{
    return fx_load16_le(p) | fx_load16_le(p + 2) << 16;
}

static inline void fx_store16_le(uint8_t *p, uint32_t x)
{
    p[0] = (uint8_t)(x & 255);
    p[1] = (uint8_t)(x >> 8 & 255);
}

static inline void fx_store32_le(uint8_t *p, uint32_t x)
{
    fx_store16_le(p, x);
    fx_store16_le(p + 2, x >> 16);
}

#endif
