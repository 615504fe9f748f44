/* SPDX-License-Identifier: MIT */
#include "rng.h"

#include <math.h>

saga_rng saga_rng_stream(uint64_t seed, uint64_t stream)
{
    const uint64_t key = saga_rng_mix(seed + SAGA_RNG_GOLDEN);

    return (saga_rng){ saga_rng_mix(
        key ^ saga_rng_mix(stream * SAGA_RNG_GOLDEN + 1)) };
}

float saga_rng_float(saga_rng r, uint64_t counter)
{
    return (float)(saga_rng_bits(r, counter) >> 40) * 0x1p-24f;
}

uint32_t saga_rng_below(saga_rng r, uint64_t counter, uint32_t n)
{
    const uint64_t bits = saga_rng_bits(r, counter);
    /* The result is bits n / 2^64. The product has 96 bits and is computed from
     * two halves. */
    const uint64_t low = (bits & 0xffffffffu) * n >> 32;

    return (uint32_t)(((bits >> 32) * n + low) >> 32);
}

/* A Feistel network permutes the numbers of 2 * half bits, the smallest such
 * range that holds n. While the result is n or more, the network is applied
 * again, which gives a permutation of 0..n-1. The range is below 4 n, so at
 * most four passes are expected. */
uint32_t saga_rng_shuffled(saga_rng r, uint64_t draw, uint32_t n)
{
    enum { ROUNDS = 4 };
    /* Every n draws have a permutation of their own. */
    const saga_rng epoch = { saga_rng_mix(
        r.key ^ saga_rng_mix((draw / n + 1) * SAGA_RNG_GOLDEN)) };
    uint32_t x = (uint32_t)(draw % n), mask;
    unsigned half = 1;

    while (half < 16 && (uint64_t)1 << (2 * half) < n)
        half++;
    mask = (uint32_t)((1u << half) - 1);
    /* Each round exchanges the halves and adds a function of one to the other.
     * It can be inverted for any f, so the result is a permutation. */
    do {
        for (uint64_t k = 0; k < ROUNDS; k++) {
            const uint32_t left = x >> half, right = x & mask;
            const uint64_t f = saga_rng_bits(epoch, k << 32 | right);

            x = right << half | (left ^ ((uint32_t)f & mask));
        }
    } while (x >= n);
    return x;
}

/* The Box-Muller transform, sqrt(-2 log u) cos(2 pi v). The second uniform
 * number comes from the same bits, mixed again. */
double saga_rng_normal(saga_rng r, uint64_t counter)
{
    const uint64_t bits = saga_rng_bits(r, counter);
    /* u is never 0, where the logarithm is infinite. */
    const double u = ((double)(bits >> 11) + 0.5) * 0x1p-53;
    const double v = (double)(saga_rng_mix(bits + SAGA_RNG_GOLDEN) >> 11) *
                     0x1p-53;

    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}
