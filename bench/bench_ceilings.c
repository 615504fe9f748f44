/* SPDX-License-Identifier: MIT
 *
 * The ceilings: the most that one thread of this machine can do. Measured are
 * dependent additions (one for each clock cycle), bytes copied in memory and
 * within the second-level cache, and multiply-adds of int16 and float in
 * registers.
 */
#include "bench_table.h"
#include "freed.h"

#include <stdint.h>
#include <string.h>

#ifdef __x86_64__
#include <immintrin.h>
#endif

enum {
    ADDS = 10000000,
    BLOCK = 1 << 26,
    NEAR = 1 << 17,
    TIMES = 1000000,
    CHAINS = 6
};

static void add(void *data)
{
    uint32_t x = 1;

    (void)data;
    for (int i = 0; i < ADDS; i++) {
        x += 3;
        __asm__ volatile("" : "+r"(x));
    }
}

static void copy(void *data)
{
    uint8_t *const p = data;

    memcpy(p + BLOCK, p, BLOCK);
}

static void copy_near(void *data)
{
    uint8_t *const p = data;

    for (int i = 0; i < BLOCK / NEAR; i++) {
        memcpy(p + NEAR, p, NEAR);
        __asm__ volatile("" : : "r"(p) : "memory");
    }
}

#define UNROLL _Pragma("GCC unroll 16")

/* The sums are independent. The empty asm makes their input unknown to the
 * compiler, which would otherwise compute them once. */
#ifdef __AVX2__
enum { MACS = 16 };
typedef __m256i vector;
#define VECTOR(name) _mm256_##name
#elif defined __SSE2__
enum { MACS = 8 };
typedef __m128i vector;
#define VECTOR(name) _mm_##name
#endif

#ifdef VECTOR
static void multiply_int16(void *data)
{
    vector sum[CHAINS], x = VECTOR(set1_epi16)(3), w = x;

    for (int k = 0; k < CHAINS; k++)
        sum[k] = x;
    for (int i = 0; i < TIMES; i++)
        UNROLL
    for (int k = 0; k < CHAINS; k++) {
        __asm__ volatile("" : "+x"(x));
        sum[k] = VECTOR(add_epi32)(sum[k], VECTOR(madd_epi16)(x, w));
    }
    for (int k = 1; k < CHAINS; k++)
        sum[0] = VECTOR(add_epi32)(sum[0], sum[k]);
    memcpy(data, &sum[0], sizeof *sum);
}
#else
enum { MACS = 1 };

static void multiply_int16(void *data)
{
    int32_t sum[CHAINS] = { 0 }, x = 3;

    for (int i = 0; i < TIMES; i++)
        UNROLL
    for (int k = 0; k < CHAINS; k++) {
        __asm__ volatile("" : "+r"(x));
        sum[k] += (int16_t)x * 5;
    }
    for (int k = 1; k < CHAINS; k++)
        sum[0] += sum[k];
    memcpy(data, sum, sizeof *sum);
}
#endif

/* Ten independent sums keep two units busy that take five cycles each. */
enum { FLOAT_CHAINS = 10 };

#ifdef __AVX512F__
enum { LANES = 16 };
typedef __m512 floats;
#define FMA(s, x) _mm512_fmadd_ps(x, x, s)
#elif defined __FMA__
enum { LANES = 8 };
typedef __m256 floats;
#define FMA(s, x) _mm256_fmadd_ps(x, x, s)
#else
enum { LANES = 4 };
typedef float floats __attribute__((vector_size(16)));
#define FMA(s, x) ((s) + (x) * (x))
#endif

#ifdef __x86_64__
#define OPAQUE(x) __asm__ volatile("" : "+x"(x))
#else
#define OPAQUE(x) __asm__ volatile("" : "+m"(x))
#endif

static void multiply_float(void *data)
{
    floats sum[FLOAT_CHAINS], x;

    memset(&x, 0, sizeof x);
    for (int k = 0; k < FLOAT_CHAINS; k++)
        sum[k] = x;
    for (int i = 0; i < TIMES; i++)
        UNROLL
    for (int k = 0; k < FLOAT_CHAINS; k++) {
        OPAQUE(x);
        sum[k] = FMA(sum[k], x);
    }
    for (int k = 1; k < FLOAT_CHAINS; k++)
        sum[0] = FMA(sum[0], sum[k]);
    memcpy(data, &sum[0], sizeof *sum);
}

static void ceiling(const char *name, void (*stage)(void *), void *data,
                    bench_kind kind, double work)
{
    bench_row *const r = bench_measure(name, stage, data);

    r->kind = kind;
    r->work = work;
    r->count = work;
    r->each = kind == BENCH_BYTES ? "a byte" : "each";
}

void bench_ceilings(void)
{
    FREED uint8_t *const p = bench_need(2 * (size_t)BLOCK);

    ceiling("ceiling: additions", add, p, BENCH_CYCLES, ADDS);
    ceiling("ceiling: memory copied", copy, p, BENCH_BYTES, BLOCK);
    ceiling("ceiling: copied in the second cache", copy_near, p, BENCH_BYTES,
            BLOCK);
    ceiling("ceiling: int16 multiply-adds", multiply_int16, p, BENCH_MACS,
            (double)TIMES * CHAINS * MACS);
    ceiling("ceiling: float multiply-adds", multiply_float, p, BENCH_FLOPS,
            2.0 * TIMES * FLOAT_CHAINS * LANES);
}
