/* SPDX-License-Identifier: MIT
 *
 * The range encoder is the inverse of decoder/range_dec, over a buffer that
 * grows to a capacity given by the caller.
 */
#ifndef SAGA_RANGE_ENC_H
#define SAGA_RANGE_ENC_H

#include <stddef.h>
#include <stdint.h>

typedef struct saga_range_enc {
    uint8_t *p;
    size_t cap, n;           /* bytes; n > cap: the buffer was too small */
    uint64_t low;            /* < 2^33: bit 32 is the carry */
    uint32_t range;
    uint64_t pending;        /* 0xff bytes a carry may still turn over */
    uint8_t cache;           /* the byte before them */
    int started;             /* the first byte out is always 0: not written */
} saga_range_enc;

void saga_range_enc_init(saga_range_enc *e, uint8_t *p, size_t cap);

/* Codes the interval [start, end) of 2^15; end = 2^15 takes the remainder. */
void saga_range_enc_interval(saga_range_enc *e, uint32_t start, uint32_t end);

/* Writes `bits` plain bits of v, most significant first. */
void saga_range_enc_bits(saga_range_enc *e, uint32_t v, uint32_t bits);

/* Writes q in -65535..65535 with the residual coder's scale index 0..63. */
void saga_range_enc_residual(saga_range_enc *e, int32_t q, uint32_t scale);

/* Writes the last byte: the shortest end the decoder reads right, with three
 * zeros after it. Returns the number of bytes, or 0 if they did not fit. */
size_t saga_range_enc_finish(saga_range_enc *e);

#endif
