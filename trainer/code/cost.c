/* SPDX-License-Identifier: MIT */
#include "cost.h"

#include <math.h>
#include <string.h>

#define RANGE_MIN (1u << 24) /* as in range_enc.c */

/* --- Single symbols ------------------------------------------------------ */

/* The code of a symbol: an interval of 2^15, then plain bits. */
typedef struct {
    uint32_t start, end, plain;
} code;

static double length_of(code x)
{
    return SAGA_PROB_BITS - log2(x.end - x.start) + x.plain;
}

/* Returns the bits of the Exp-Golomb code of v: its prefix and its remainder,
 * whose order grows up to 16. */
static uint32_t escape_bits(uint32_t v)
{
    uint32_t order = SAGA_ESCAPE_ORDER, prefix = 0;

    while (order < 16 && v >= 1u << order) {
        v -= 1u << order;
        order++;
        prefix++;
    }
    return prefix + (order < 16) + order;
}

static code code_residual(int32_t q, uint32_t scale)
{
    const saga_scale_row row = saga_prob_scale(scale);
    const uint32_t m = (uint32_t)(q < 0 ? -q : q);
    code x = { 0, SAGA_PROB_TOTAL, 0 };
    uint32_t half;

    if (m > row.max) {
        /* The interval of an escape goes to the end. After it, the remainder of
         * |q| and the sign are plain bits. */
        x.start = row.start[row.max + 1];
        x.plain = escape_bits(m - row.max - 1) + 1;
        return x;
    }
    x.start = row.start[m];
    x.end = row.start[m + 1];
    /* +m and -m share an interval: the first half is +m, the second -m. */
    half = (x.start + x.end) >> 1;
    if (q > 0)
        x.end = half;
    else if (q < 0)
        x.start = half;
    return x;
}

static code code_adaptive(const saga_adaptive *m, uint32_t n_sym, uint32_t sym)
{
    const code x = { saga_adaptive_start(m, sym),
                     sym + 1 < n_sym ? m->start[sym] : SAGA_PROB_TOTAL, 0 };

    return x;
}

double saga_cost_residual(int32_t q, uint32_t scale)
{
    return length_of(code_residual(q, scale));
}

/* --- The coder ----------------------------------------------------------- */

static void renormalise(saga_cost *k)
{
    while (k->range < RANGE_MIN)
        k->range <<= 8;
}

/* Changes the range as range_enc.c does; `low` has no influence. */
static void spend(saga_cost *k, saga_at at, code x)
{
    const uint32_t before = k->range, r = before >> SAGA_PROB_BITS;
    uint32_t i;

    k->range = x.end == SAGA_PROB_TOTAL ? before - r * x.start
                                        : r * (x.end - x.start);
    /* `spent` is what the range lost, `bits` what the frequencies give. */
    k->spent[at.sym] += log2((double)before / k->range) + x.plain;
    k->bits[at.sym] += length_of(x);
    if (saga_component_of(at.sym) == SAGA_COMPONENT_NETWORKS)
        k->net_bits[at.index] += length_of(x);
    renormalise(k);
    /* Halving a range of at least 2^24 loses less than 2^-23 bits. */
    for (i = 0; i < x.plain; i++) {
        k->range >>= 1;
        renormalise(k);
    }
}

static void residual(saga_coder *c, saga_at at, int32_t *q, const int16_t *mu,
                     uint32_t step_q16, const uint8_t *scale, uint32_t n)
{
    saga_cost *const k = (saga_cost *)(void *)c;
    uint32_t i;

    k->inner->residual(k->inner, at, q, mu, step_q16, scale, n);
    c->error = k->inner->error;
    for (i = 0; i < n; i++)
        spend(k, at, code_residual(q[i], scale[i]));
}

/* inner updates the adaptive model; the cost is by its state before. */
static uint32_t adaptive(saga_coder *c, saga_at at, saga_adaptive *m,
                         uint32_t n_sym)
{
    saga_cost *const k = (saga_cost *)(void *)c;
    const saga_adaptive before = *m;
    const uint32_t sym = k->inner->adaptive(k->inner, at, m, n_sym);

    c->error = k->inner->error;
    spend(k, at, code_adaptive(&before, n_sym, sym));
    return sym;
}

static uint32_t uniform(saga_coder *c, saga_at at, uint32_t bits)
{
    saga_cost *const k = (saga_cost *)(void *)c;
    const uint32_t v = k->inner->uniform(k->inner, at, bits);
    /* The whole interval of 2^15 leaves the range unchanged. */
    const code x = { 0, SAGA_PROB_TOTAL, bits };

    c->error = k->inner->error;
    spend(k, at, x);
    return v;
}

void saga_cost_init(saga_cost *c, saga_coder *inner)
{
    memset(c, 0, sizeof *c);
    c->coder.residual = residual;
    c->coder.adaptive = adaptive;
    c->coder.uniform = uniform;
    c->inner = inner;
    c->range = 0xffffffffu;
}

/* --- Components ---------------------------------------------------------- */

saga_component saga_component_of(uint32_t sym)
{
    switch (sym) {
    case SAGA_SYM_SPLIT:
    case SAGA_SYM_OCCUPANCY:
    case SAGA_SYM_N_FINE:
        return SAGA_COMPONENT_TREE;
    case SAGA_SYM_CLASS:
        return SAGA_COMPONENT_CLASS;
    case SAGA_SYM_CENTRE:
        return SAGA_COMPONENT_CENTRE;
    case SAGA_SYM_FEATURE:
        return SAGA_COMPONENT_FEATURE;
    case SAGA_SYM_FINE_SUFFIX:
        return SAGA_COMPONENT_FINE_SUFFIX;
    case SAGA_SYM_FINE_OFFSET:
        return SAGA_COMPONENT_FINE_OFFSET;
    case SAGA_SYM_N_PRIM:
        return SAGA_COMPONENT_N_PRIM;
    case SAGA_SYM_PRIM_SUFFIX:
        return SAGA_COMPONENT_PRIM_SUFFIX;
    case SAGA_SYM_PRIM_OFFSET:
        return SAGA_COMPONENT_PRIM_OFFSET;
    default:
        return SAGA_COMPONENT_NETWORKS;
    }
}

const char *saga_component_name(saga_component c)
{
    static const char *const names[SAGA_N_COMPONENTS] = {
        "networks",           "tree",
        "coarse classes",     "coarse centres",
        "coarse features",    "fine suffixes",
        "fine offsets",       "primitive counts",
        "primitive suffixes", "primitive offsets"
    };

    return names[c];
}

const char *saga_component_key(saga_component c)
{
    static const char *const keys[SAGA_N_COMPONENTS] = {
        "networks",           "tree",
        "coarse_classes",     "coarse_centres",
        "coarse_features",    "fine_suffixes",
        "fine_offsets",       "primitive_counts",
        "primitive_suffixes", "primitive_offsets"
    };

    return keys[c];
}

void saga_cost_components(double sum[SAGA_N_COMPONENTS],
                          const double bits[SAGA_N_SYMS])
{
    uint32_t i;

    for (i = 0; i < SAGA_N_COMPONENTS; i++)
        sum[i] = 0;
    for (i = 0; i < SAGA_N_SYMS; i++)
        sum[saga_component_of(i)] += bits[i];
}
