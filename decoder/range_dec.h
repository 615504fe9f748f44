/* SPDX-License-Identifier: MIT
 *
 * Range decoder: 32 bits with carry, bytewise, no division. One of the coders
 * behind the traversal (prob.h); trainer/code/range_enc is its inverse.
 */
#ifndef SAGA_RANGE_DEC_H
#define SAGA_RANGE_DEC_H

#include "tally.h"
#include "prob.h"

#include <stddef.h>
#include <stdint.h>

typedef struct saga_range_dec {
    saga_coder coder; /* first: its functions cast back */
    const uint8_t *p;
    size_t n;   /* bytes of the chunk */
    size_t pos; /* bytes read; n + 3 at the end, zeros past n */
    uint32_t range, code;
    saga_tally *tally; /* counts the symbols; may be NULL. If it stops,
                        * that is an error of the coder */
} saga_range_dec;

/* Starts decoding p[0..n), which must stay valid until the chunk is decoded. */
void saga_range_dec_init(saga_range_dec *d, const uint8_t *p, size_t n);

/* Returns 1 if there was no error and exactly the chunk's bytes were consumed,
 * else 0. */
int saga_range_dec_finish(const saga_range_dec *d);

#endif
