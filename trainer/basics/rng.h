/* SPDX-License-Identifier: MIT
 *
 * Random numbers have no state: each is value number `counter` of stream
 * `stream` of a seed. Nothing has to be saved for a run to resume, and threads
 * may draw in any order. Not for secrets.
 */
#ifndef SAGA_RNG_H
#define SAGA_RNG_H

#include <stdint.h>

/* A stream identifies a sequence; build once, copy freely. */
typedef struct saga_rng { uint64_t key; } saga_rng;

/* Streams of one seed are unrelated, and so are seeds. */
saga_rng saga_rng_stream(uint64_t seed, uint64_t stream);

uint64_t saga_rng_bits(saga_rng r, uint64_t counter);

/* Uniform numbers in [0, 1): 24 bits as float, 53 as double. */
float saga_rng_float(saga_rng r, uint64_t counter);
double saga_rng_double(saga_rng r, uint64_t counter);

/* Returns a number in 0..n-1, n >= 1; bias below n / 2^64. */
uint32_t saga_rng_below(saga_rng r, uint64_t counter, uint32_t n);

/* Draws numbers of 0..n-1 (n >= 1) without replacement: draws 0..n-1 give each
 * of them once in random order, the next n draws give each once in another
 * order, and so on. */
uint32_t saga_rng_shuffled(saga_rng r, uint64_t draw, uint32_t n);

/* Draws from the normal distribution of mean 0, variance 1. */
double saga_rng_normal(saga_rng r, uint64_t counter);

#endif
