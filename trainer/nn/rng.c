/* SPDX-License-Identifier: MIT
 *
 * A counter times an odd constant, keyed, through two rounds of multiply and
 * xor-shift (Stafford's variant 13 of the 64-bit finaliser, as in SplitMix64).
 */
#include "rng.h"

#include <math.h>

#define GOLDEN 0x9e3779b97f4a7c15u

static uint64_t mix(uint64_t x)
{
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
    return x ^ (x >> 31);
}

saga_rng saga_rng_stream(uint64_t seed, uint64_t stream)
{
    const uint64_t key = mix(seed + GOLDEN);

    return (saga_rng){ mix(key ^ mix(stream * GOLDEN + 1)) };
}

/* The key enters twice: two keys do not give the same sequence shifted. */
uint64_t saga_rng_bits(saga_rng r, uint64_t counter)
{
    return mix(mix(counter * GOLDEN + r.key) ^ r.key);
}

float saga_rng_float(saga_rng r, uint64_t counter)
{
    return (float)(saga_rng_bits(r, counter) >> 40) * 0x1p-24f;
}

double saga_rng_double(saga_rng r, uint64_t counter)
{
    return (double)(saga_rng_bits(r, counter) >> 11) * 0x1p-53;
}

uint32_t saga_rng_below(saga_rng r, uint64_t counter, uint32_t n)
{
    const uint64_t bits = saga_rng_bits(r, counter);
    const uint64_t low = (bits & 0xffffffffu) * n >> 32;

    return (uint32_t)(((bits >> 32) * n + low) >> 32);
}

/* Box and Muller; the second uniform comes from the same bits, mixed again. */
double saga_rng_normal(saga_rng r, uint64_t counter)
{
    const uint64_t bits = saga_rng_bits(r, counter);
    const double u = ((double)(bits >> 11) + 0.5) * 0x1p-53;
    const double v = (double)(mix(bits + GOLDEN) >> 11) * 0x1p-53;

    return sqrt(-2 * log(u)) * cos(6.283185307179586 * v);
}
