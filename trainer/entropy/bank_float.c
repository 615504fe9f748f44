/* SPDX-License-Identifier: MIT */
#include "bank_float.h"

#include "alloc.h"
#include "dense.h"
#include "memory_bank.h"
#include "vec.h"

#include <stdlib.h>
#include <string.h>

/* Queries that are answered together. */
enum { CHUNK = 128 };

#define LN2 R(0.69314718055994530942)

/* --- States -------------------------------------------------------------- */

bool saga_bank_float_start(real *state, size_t n_slots, size_t width,
                           saga_error *error)
{
    saga_bank bank = { .n_slots = (uint32_t)n_slots, .width = (uint32_t)width };
    const size_t stride = saga_mlp_pad(bank.width);
    uint8_t *const block = saga_aligned_alloc(16, saga_bank_lay(&bank, NULL),
                                              "the memory bank", error);
    size_t p, i;

    if (!block)
        return false;
    saga_bank_lay(&bank, block);
    saga_bank_start(&bank);
    for (p = 0; p < n_slots; p++)
        for (i = 0; i < width; i++)
            state[p * width + i] = R(bank.slot[p * stride + i]) / 4096;
    free(block);
    return true;
}

size_t saga_bank_float_scratch(size_t n_slots, size_t width)
{
    return n_slots * width + 2 * CHUNK * n_slots;
}

saga_bank_float saga_bank_float_of(const real *state, size_t n_slots,
                                   size_t width, real *scratch)
{
    real *const weight = scratch + n_slots * width;
    const saga_bank_float b = { n_slots, width,  state,
                                scratch, weight, weight + CHUNK * n_slots };
    size_t p, i;

    for (p = 0; p < n_slots; p++)
        for (i = 0; i < width; i++)
            b.columns[i * n_slots + p] = state[p * width + i];
    return b;
}

/* --- Reads --------------------------------------------------------------- */

/* Turns scores into weights that sum to 1. A score 100 or more below the
 * largest counts as 100 below. */
static void softmax(real *x, size_t n)
{
    vec most = vec_load(x), sum = vec_zero();
    real top;
    size_t i;

    /* Scores are taken relative to the largest, so no power of 2 overflows, and
     * the sum is at least 1. */
    for (i = VEC_LANES; i < n; i += VEC_LANES)
        most = vec_max(most, vec_load(x + i));
    for (top = most[0], i = 1; i < VEC_LANES; i++)
        top = most[i] > top ? most[i] : top;
    for (i = 0; i < n; i += VEC_LANES) {
        const vec below = vec_set1(top) - vec_load(x + i);
        const vec e = vec_exp2_neg(vec_min(below, vec_set1(100)));

        vec_store(x + i, e);
        sum += e;
    }
    for (top = 1 / vec_sum(sum), i = 0; i < n; i += VEC_LANES)
        vec_store(x + i, vec_load(x + i) * vec_set1(top));
}

static void weigh(const saga_bank_float *b, const real *query, size_t n)
{
    const saga_dense columns = { .w = b->columns, .n_out = b->n_slots };
    const saga_dense_rows queries = { query, n, b->width, b->width };
    size_t i;

    saga_dense_forward(b->weight, &columns, &queries);
    for (i = 0; i < n; i++)
        softmax(b->weight + i * b->n_slots, b->n_slots);
}

static size_t chunk(size_t n)
{
    return n < CHUNK ? n : CHUNK;
}

void saga_bank_float_read(real *out, const saga_bank_float *b,
                          const real *query, size_t n)
{
    const size_t d = b->width;
    const saga_dense state = { .w = b->state, .n_out = d };
    size_t at;

    for (at = 0; at < n; at += CHUNK) {
        const size_t some = chunk(n - at);
        const saga_dense_rows weights = { b->weight, some, b->n_slots,
                                          b->n_slots };

        weigh(b, query + at * d, some);
        saga_dense_forward(out + at * d, &state, &weights);
    }
}

/* Turns gradients of weights into gradients of scores, in base 2. */
static void softmax_backward(real *d, const real *weight, size_t n)
{
    vec sum = vec_zero();
    real dot;
    size_t i;

    /* With w_i = 2^x_i / sum, dw_i / dx_k = ln 2 w_i ([i = k] - w_k), so d
     * becomes ln 2 w (d - <d, w>). */
    for (i = 0; i < n; i += VEC_LANES)
        sum = vec_fma(vec_load(d + i), vec_load(weight + i), sum);
    for (dot = vec_sum(sum), i = 0; i < n; i += VEC_LANES)
        vec_store(d + i, vec_set1(LN2) * vec_load(weight + i) *
                             (vec_load(d + i) - vec_set1(dot)));
}

void saga_bank_float_read_backward(real *d_query, real *d_state,
                                   const saga_bank_float *b, const real *d_out,
                                   const real *query, size_t n)
{
    const size_t d = b->width, slots = b->n_slots;
    const saga_dense columns = { .w = b->columns, .n_out = slots };
    const saga_dense state = { .w = b->state, .n_out = d };
    size_t at, i;

    for (at = 0; at < n; at += CHUNK) {
        const size_t some = chunk(n - at);
        const saga_dense_rows q = { query + at * d, some, d, d };
        const saga_dense_rows d_read = { d_out + at * d, some, d, d };
        const saga_dense_rows weights = { b->weight, some, slots, slots };
        const saga_dense_rows d_weights = { b->d_weight, some, slots, slots };

        /* The weights are computed again, since the scratch holds only those of
         * one chunk. */
        weigh(b, q.at, some);
        saga_dense_forward(b->d_weight, &columns, &d_read);
        for (i = 0; i < some; i++)
            softmax_backward(b->d_weight + i * slots, b->weight + i * slots,
                             slots);
        /* The read is W S, where W is computed from Q S^T, so S gets gradients
         * from both. */
        saga_dense_forward(d_query + at * d, &state, &d_weights);
        saga_dense_backward(d_state, &weights, &d_read);
        saga_dense_backward(d_state, &d_weights, &q);
    }
}

/* --- Update of a slot ---------------------------------------------------- */

static real dot(const real *a, const real *b, size_t n)
{
    real sum = 0;
    size_t i;

    for (i = 0; i < n; i++)
        sum += a[i] * b[i];
    return sum;
}

static real sigmoid(real x)
{
    return 1 / (1 + exp(-x));
}

/* Sets u to the slot before its normalisation and *along to <v, s>. Returns the
 * length of u. */
static real update(real *u, real *along, const real *s, const real *write,
                   size_t n, int plain)
{
    const real g = sigmoid(write[n]);
    size_t i;

    /* Equations (5) and (6) of the paper, where |s| = 1 makes the denominator
     * of (5) 1. */
    *along = plain ? 0 : dot(write, s, n);
    for (i = 0; i < n; i++)
        u[i] = s[i] + g * (write[i] - *along * s[i]);
    return sqrt(dot(u, u, n));
}

void saga_bank_float_update(real *to, const real *s, const real *write,
                            size_t n, int plain)
{
    real along, length = update(to, &along, s, write, n, plain);
    size_t i;

    if (length > 0)
        for (i = 0; i < n; i++)
            to[i] /= length;
    else
        memcpy(to, s, n * sizeof *to);
}

void saga_bank_float_update_backward(real *d, real *d_write, const real *s,
                                     const real *write, size_t n, int plain)
{
    const real g = sigmoid(write[n]);
    real u[SAGA_MAX_SLOT_WIDTH], along, d_along = 0, d_gate = 0, part;
    const real length = update(u, &along, s, write, n, plain);
    size_t i;

    memset(d_write, 0, (n + 1) * sizeof *d_write);
    /* A sum of 0 has left the slot unchanged, and d stays the same. */
    if (!(length > 0))
        return;
    /* Back through u / |u|: d becomes (d - u <d, u> / |u|^2) / |u|. The same
     * loop sums the gradients of g and of <v, s>. */
    part = dot(d, u, n) / (length * length);
    for (i = 0; i < n; i++) {
        d[i] = (d[i] - part * u[i]) / length;
        d_gate += d[i] * (write[i] - along * s[i]);
        d_along -= g * d[i] * s[i];
    }
    for (i = 0; i < n; i++) {
        /* u = s + g (v - <v, s> s), so v and s also get gradients through <v,
         * s>. */
        d_write[i] = g * d[i] + (plain ? 0 : d_along * s[i]);
        d[i] += plain ? 0 : d_along * write[i] - along * g * d[i];
    }
    d_write[n] = d_gate * g * (1 - g);
}

SAGA_ISA_CHOOSE(saga_bank_float_start);
SAGA_ISA_CHOOSE(saga_bank_float_scratch);
SAGA_ISA_CHOOSE(saga_bank_float_of);
SAGA_ISA_CHOOSE(saga_bank_float_read);
SAGA_ISA_CHOOSE(saga_bank_float_read_backward);
SAGA_ISA_CHOOSE(saga_bank_float_update);
SAGA_ISA_CHOOSE(saga_bank_float_update_backward);
