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
    saga_coder coder;        /* first: its functions cast back */
    const uint8_t *p;
    size_t n;                /* bytes of the chunk */
    size_t pos;              /* bytes read; n + 3 at the end, zeros past n */
    uint32_t range, code;
    saga_tally *tally;       /* of the symbols; NULL: nobody counts. When it
                              * stops that is an error */
} saga_range_dec;

/* Begins to decode p[0..n), which must stay valid until the chunk is done. */
void saga_range_dec_init(saga_range_dec *d, const uint8_t *p, size_t n);

/* 1 if nothing was wrong and exactly the chunk's bytes were consumed. */
int saga_range_dec_finish(const saga_range_dec *d);

#endif
