/* SPDX-License-Identifier: MIT */
#include "range_enc.h"

#include "prob.h"

#define RANGE_MIN (1u << 24)

static void put(saga_range_enc *e, uint32_t byte)
{
    /* The first byte is the carry of the whole code, which is always 0. */
    if (!e->started) {
        e->started = 1;
        return;
    }
    if (e->n < e->cap)
        e->p[e->n] = (uint8_t)byte;
    e->n++;
}

/* Moves the top byte of low out, or counts it as pending while a carry could
 * change it. */
static void shift_low(saga_range_enc *e)
{
    const uint32_t carry = (uint32_t)(e->low >> 32);
    const uint32_t top = (uint32_t)(e->low >> 24) & 255u;

    /* A later carry would turn 255 into 0 and propagate to the byte before.
     * Such bytes are counted, and wait after the one in `cache`. */
    if (top == 255 && !carry) {
        e->pending++;
    } else {
        put(e, (e->cache + carry) & 255u);
        for (; e->pending > 0; e->pending--)
            put(e, (255u + carry) & 255u);
        e->cache = (uint8_t)top;
    }
    e->low = (e->low & (RANGE_MIN - 1)) << 8;
}

static void renormalise(saga_range_enc *e)
{
    while (e->range < RANGE_MIN) {
        e->range <<= 8;
        shift_low(e);
    }
}

void saga_range_enc_init(saga_range_enc *e, uint8_t *p, size_t cap)
{
    e->p = p;
    e->cap = cap;
    e->n = 0;
    e->low = 0;
    e->range = 0xffffffffu;
    e->pending = 0;
    e->cache = 0;
    e->started = 0;
}

void saga_range_enc_interval(saga_range_enc *e, uint32_t start, uint32_t end)
{
    const uint32_t r = e->range >> SAGA_PROB_BITS;

    e->low += (uint64_t)r * start;
    /* The interval that ends at 2^15 also gets what rounding r down left. */
    e->range = end == SAGA_PROB_TOTAL ? e->range - r * start
                                      : r * (end - start);
    renormalise(e);
}

void saga_range_enc_bits(saga_range_enc *e, uint32_t v, uint32_t bits)
{
    while (bits-- > 0) {
        e->range >>= 1;
        /* A 1 takes the upper half of the range. */
        if (v >> bits & 1u)
            e->low += e->range;
        renormalise(e);
    }
}

static void escape(saga_range_enc *e, uint32_t v, uint32_t max)
{
    uint32_t bits = SAGA_ESCAPE_ORDER;

    v -= max + 1;
    /* Each 1 of the prefix skips a class of 2^bits values. A 0 ends it, except
     * after the last class. */
    while (bits < 16 && v >= 1u << bits) {
        saga_range_enc_bits(e, 1, 1);
        v -= 1u << bits;
        bits++;
    }
    if (bits < 16)
        saga_range_enc_bits(e, 0, 1);
    saga_range_enc_bits(e, v, bits);
}

void saga_range_enc_residual(saga_range_enc *e, int32_t q, uint32_t scale)
{
    const saga_scale_row row = saga_prob_scale(scale);
    const uint32_t m = (uint32_t)(q < 0 ? -q : q);
    uint32_t start, end, half;

    if (m > row.max) {
        saga_range_enc_interval(e, row.start[row.max + 1], SAGA_PROB_TOTAL);
        escape(e, m, row.max);
        saga_range_enc_bits(e, q < 0, 1);
        return;
    }
    start = row.start[m];
    end = row.start[m + 1];
    half = (start + end) >> 1;
    if (m == 0)
        saga_range_enc_interval(e, 0, end);
    else if (q > 0)
        saga_range_enc_interval(e, start, half);
    else
        saga_range_enc_interval(e, half, end);
}

size_t saga_range_enc_finish(saga_range_enc *e)
{
    /* range >= 2^24, so there is a multiple of 2^24 in [low, low + range). */
    e->low = (e->low + (RANGE_MIN - 1)) & ~(uint64_t)(RANGE_MIN - 1);
    /* The byte moves into the cache and out of it. The three bytes below are 0,
     * and decoders read zeros after the end. */
    shift_low(e);
    shift_low(e);
    return e->n <= e->cap ? e->n : 0;
}
