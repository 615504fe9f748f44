/* SPDX-License-Identifier: MIT
 *
 * The range encoder, inverse of decoder/range_dec, writes into a buffer of
 * fixed capacity.
 */
#ifndef SAGA_RANGE_ENC_H
#define SAGA_RANGE_ENC_H

#include <stddef.h>
#include <stdint.h>

typedef struct saga_range_enc {
    uint8_t *p;
    size_t cap, n; /* bytes written; n > cap: the buffer was too
                    * small */
    uint64_t low;  /* below 2^33; bit 32 is the carry */
    uint32_t range;
    uint64_t pending; /* number of 0xff bytes that a carry may still
                       * change */
    uint8_t cache;    /* the byte before the pending ones */
    int started;      /* 0 before the first byte, which is always 0 and
                       * not written */
} saga_range_enc;

void saga_range_enc_init(saga_range_enc *e, uint8_t *p, size_t cap);

/* Codes the interval [start, end) of 2^15. end = 2^15 takes the remainder of
 * the range. */
void saga_range_enc_interval(saga_range_enc *e, uint32_t start, uint32_t end);

/* Writes the lowest `bits` bits of v without a model, most significant
 * first. */
void saga_range_enc_bits(saga_range_enc *e, uint32_t v, uint32_t bits);

/* Writes residual q, -65535..65535, with scale index 0..63. */
void saga_range_enc_residual(saga_range_enc *e, int32_t q, uint32_t scale);

/* Writes the shortest end that the decoder reads correctly when three zeros
 * follow. Returns the number of bytes, or 0 if they did not fit. */
size_t saga_range_enc_finish(saga_range_enc *e);

#endif
