/* SPDX-License-Identifier: MIT
 *
 * Random numbers without a state: each is determined by a seed, a stream and a
 * counter. A run can resume without saved state, and threads may draw in any
 * order. Not for cryptography.
 *
 * Each number is a counter times an odd constant, combined with the key, after
 * two rounds of multiply and xor-shift (Stafford's variant 13 of the 64-bit
 * finaliser, as in SplitMix64).
 */
#ifndef SAGA_RNG_H
#define SAGA_RNG_H

#include <stdint.h>

/* A stream of a seed. It may be copied freely. */
typedef struct saga_rng {
    uint64_t key;
} saga_rng;

/* Streams are independent of each other, and so are seeds. */
saga_rng saga_rng_stream(uint64_t seed, uint64_t stream);

#define SAGA_RNG_GOLDEN 0x9e3779b97f4a7c15u

static inline uint64_t saga_rng_mix(uint64_t x)
{
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

/* The key enters twice, so that the sequences of two keys are not shifted
 * copies. */
static inline uint64_t saga_rng_bits(saga_rng r, uint64_t counter)
{
    return saga_rng_mix(saga_rng_mix(counter * SAGA_RNG_GOLDEN + r.key) ^
                        r.key);
}

/* Return uniform numbers in [0, 1), with 24 bits in float and 53 in double. */
float saga_rng_float(saga_rng r, uint64_t counter);
static inline double saga_rng_double(saga_rng r, uint64_t counter)
{
    return (double)(saga_rng_bits(r, counter) >> 11) * 0x1p-53;
}

/* Returns a number in 0..n-1, n >= 1, with a bias below n / 2^64. */
uint32_t saga_rng_below(saga_rng r, uint64_t counter, uint32_t n);

/* Returns number `draw` of a sequence of permutations of 0..n-1, n >= 1: draws
 * 0..n-1 give each number once in random order, the next n draws give each once
 * in another order, and so on. */
uint32_t saga_rng_shuffled(saga_rng r, uint64_t draw, uint32_t n);

/* Returns a number from the normal distribution with mean 0 and variance 1. */
double saga_rng_normal(saga_rng r, uint64_t counter);

#endif
