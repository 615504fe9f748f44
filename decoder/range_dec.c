/* SPDX-License-Identifier: MIT */
#include "range_dec.h"

/* Renormalisation keeps range >= 2^24. Therefore range >> 15 is at least 2^9,
 * and every symbol with a frequency of 1 or more has a non-empty interval. */
#define RANGE_MIN (1u << 24)

/* Pairs of a residual's table that one step of the search passes over. Most
 * tables are shorter, and pay nothing for it. */
enum { STRIDE = 32 };

/* Number of zero bytes that the encoder always omits at the end of a chunk,
 * since its last value is a multiple of 2^24. */
enum { TAIL = 3 };

static uint32_t next_byte(saga_range_dec *d)
{
    const uint32_t byte = d->pos < d->n ? d->p[d->pos] : 0;

    if (d->pos >= d->n + TAIL)
        d->coder.error = 1;
    else
        d->pos++;
    return byte;
}

static void renormalise(saga_range_dec *d)
{
    while (d->range < RANGE_MIN) {
        d->range <<= 8;
        d->code = d->code << 8 | next_byte(d);
    }
}

/* Reduces the range to the interval [start, end) of 2^15. The last symbol (end
 * = 2^15) gets the remainder of the range. r = range >> 15. */
static void narrow(saga_range_dec *d, uint32_t r, uint32_t start, uint32_t end)
{
    d->code -= r * start;
    d->range = end == SAGA_PROB_TOTAL ? d->range - r * start
                                      : r * (end - start);
    renormalise(d);
}

static uint32_t bypass(saga_range_dec *d, uint32_t bits)
{
    uint32_t v = 0;

    while (bits-- > 0) {
        uint32_t bit;

        d->range >>= 1;
        bit = d->code >= d->range;
        if (bit)
            d->code -= d->range;
        /* Halving an odd range drops its last value, which no encoder uses. */
        if (d->code >= d->range)
            d->coder.error = 1;
        v = v << 1 | bit;
        renormalise(d);
    }
    return v;
}

/* Reads a residual beyond the table: |q| - M - 1 as an Exp-Golomb code, then
 * the sign. */
static int32_t escaped(saga_range_dec *d, uint32_t max)
{
    uint32_t bits = SAGA_ESCAPE_ORDER, v = 0, sign;

    while (bits < 16 && bypass(d, 1)) {
        v += 1u << bits;
        bits++;
    }
    v += bypass(d, bits) + max + 1;
    sign = bypass(d, 1);
    if (v > SAGA_MAX_RESIDUAL) {
        d->coder.error = 1;
        return 0;
    }
    return sign ? -(int32_t)v : (int32_t)v;
}

/* Counts n symbols as work. */
static void count(saga_range_dec *d, uint32_t n)
{
    d->coder.error |= saga_tally_add(d->tally, n * SAGA_TALLY_SYMBOL);
}

/* Reads a residual. The search goes through the pairs +m, -m from the centre
 * outwards, first in strides and then one by one, and compares by
 * multiplication instead of division. Strides keep a hostile file, whose
 * residuals all lie at the end of the widest table, from taking 224 steps for
 * each. Halving takes fewer steps, but the processor guesses each of them wrong
 * half of the time: it made an ordinary film 5 % slower. */
static int32_t one_residual(saga_range_dec *d, uint32_t scale)
{
    const saga_scale_row row = saga_prob_scale(scale);
    const uint32_t r = d->range >> SAGA_PROB_BITS;
    uint32_t m = 0, start, end, half;

    while (m + STRIDE <= row.max && d->code >= r * row.start[m + STRIDE])
        m += STRIDE;
    while (m <= row.max && d->code >= r * row.start[m + 1])
        m++;
    start = row.start[m];
    /* What is left beyond the table's last pair is the escape. */
    if (m > row.max) {
        narrow(d, r, start, SAGA_PROB_TOTAL);
        return escaped(d, row.max);
    }
    end = row.start[m + 1];
    if (m == 0) {
        narrow(d, r, 0, end);
        return 0;
    }
    /* The first half of the pair's range is +m, the second -m. */
    half = (start + end) >> 1;
    if (d->code < r * half) {
        narrow(d, r, start, half);
        return (int32_t)m;
    }
    narrow(d, r, half, end);
    return -(int32_t)m;
}

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    saga_range_dec *const d = (saga_range_dec *)(void *)c;
    uint32_t i;

    (void)at;
    (void)mu;
    (void)step_q16;
    count(d, n);
    for (i = 0; i < n; i++)
        q[i] = one_residual(d, scale[i]);
}

static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    saga_range_dec *const d = (saga_range_dec *)(void *)c;
    const uint32_t r = d->range >> SAGA_PROB_BITS;
    uint32_t sym = 0, end;

    (void)at;
    count(d, 1);
    while (sym + 1 < n_sym && d->code >= r * m->start[sym])
        sym++;
    end = sym + 1 < n_sym ? m->start[sym] : SAGA_PROB_TOTAL;
    narrow(d, r, saga_adaptive_start(m, sym), end);
    saga_adaptive_update(m, n_sym, sym);
    return sym;
}

static uint32_t uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    (void)at;
    return bypass((saga_range_dec *)(void *)c, bits);
}

void saga_range_dec_init(saga_range_dec *d, const uint8_t *p, size_t n)
{
    int i;

    d->coder.residual = residual;
    d->coder.adaptive = adaptive;
    d->coder.uniform = uniform;
    d->coder.error = 0;
    d->p = p;
    d->n = n;
    d->pos = 0;
    d->range = 0xffffffffu;
    d->tally = NULL;
    d->code = 0;
    for (i = 0; i < 4; i++)
        d->code = d->code << 8 | next_byte(d);
    /* The code must lie inside the range, which is not certain at the start. */
    if (d->code >= d->range)
        d->coder.error = 1;
}

int saga_range_dec_finish(const saga_range_dec *d)
{
    return !d->coder.error && d->pos == d->n + TAIL;
}
