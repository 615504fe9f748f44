/* SPDX-License-Identifier: MIT
 *
 * Inner products of two points at a time in words of 64 bits: twins of mlp.c's
 * plain loops, bit for bit, for machines of 64 bits without vectors. mlp.c
 * includes it there.
 *
 * A word holds a pair of activations as x + 2^32 y, so that one product with a
 * weight is both products, and one sum both sums, all modulo 2^64. In between
 * the halves may run into one another; a sum's end is s + 2^32 t, and since
 * neither overflows 32 bits (saga_mlp_row_is_valid) s is the lower half and t
 * what remains. What is split earlier is joined to the same word again.
 */
#ifndef SAGA_MLP_PAIRS_H
#define SAGA_MLP_PAIRS_H

#include "mlp_layer.h"

#include <stddef.h>
#include <stdint.h>

#define SAGA_MLP_PAIRED 32u

/* Some rows and two points: 512 bytes of stack, which are scarce. */
typedef struct {
    int32_t sum[2][SAGA_MLP_PAIRED];     /* of each point, by rows */
    uint32_t n_row;
    uint32_t n;
    uint64_t pair[SAGA_MLP_PAIRED];      /* of n inputs at a time */
} saga_pairs;

/* x: (points, stride); of one point the other half is empty. */
static inline void make_pairs(saga_pairs *p, const int16_t *x, uint32_t stride,
                              uint32_t points)
{
    uint32_t k;

    for (k = 0; k < p->n; k++)
        p->pair[k] = (uint64_t)x[k];
    for (k = 0; k < p->n && points == 2; k++)
        p->pair[k] += (uint64_t)x[stride + k] << 32;
}

static inline uint64_t join_sums(const saga_pairs *p, uint32_t r)
{
    return (uint64_t)p->sum[0][r] + ((uint64_t)p->sum[1][r] << 32);
}

static inline void split_sums(saga_pairs *p, uint32_t r, uint64_t both)
{
    p->sum[0][r] = (int32_t)(uint32_t)both;
    p->sum[1][r] = (int32_t)(uint32_t)((both - (uint64_t)p->sum[0][r]) >> 32);
}

static inline uint64_t weight_at(const void *w, size_t at, int int8)
{
    return int8 ? (uint64_t)((const int8_t *)w)[at]
                : (uint64_t)((const int16_t *)w)[at];
}

/* Adds the products of the pairs and the weights, from `at` on in the first
 * row, `stride` further in the next. Four rows share every load of a pair;
 * inlined, `int8` is known. */
static inline __attribute__((always_inline))
void add_products(saga_pairs *p, const void *w, size_t at, size_t stride,
                  int int8)
{
    uint32_t r = 0, k;

    for (; r + 4 <= p->n_row; r += 4, at += 4 * stride) {
        uint64_t a = join_sums(p, r), b = join_sums(p, r + 1);
        uint64_t c = join_sums(p, r + 2), d = join_sums(p, r + 3);

        for (k = 0; k < p->n; k++) {
            a += p->pair[k] * weight_at(w, at + k, int8);
            b += p->pair[k] * weight_at(w, at + stride + k, int8);
            c += p->pair[k] * weight_at(w, at + 2 * stride + k, int8);
            d += p->pair[k] * weight_at(w, at + 3 * stride + k, int8);
        }
        split_sums(p, r, a);
        split_sums(p, r + 1, b);
        split_sums(p, r + 2, c);
        split_sums(p, r + 3, d);
    }
    for (; r < p->n_row; r++, at += stride) {
        uint64_t a = join_sums(p, r);

        for (k = 0; k < p->n; k++)
            a += p->pair[k] * weight_at(w, at + k, int8);
        split_sums(p, r, a);
    }
}

/* p->sum = the inner products of one or two points x, (points, pad(n_in)), and
 * p->n_row rows from `row` on. Weights are placed by rows. */
static inline void sum_pairs(saga_pairs *p, const saga_layer *layer,
                             const int16_t *x, uint32_t row, uint32_t points)
{
    const uint32_t stride = saga_mlp_pad(layer->n_in);
    uint32_t r, k, left;

    for (r = 0; r < p->n_row; r++)
        p->sum[0][r] = p->sum[1][r] = 0;
    for (k = 0; k < layer->n_in; k += SAGA_MLP_PAIRED) {
        const size_t at = (size_t)row * stride + k;

        left = layer->n_in - k;
        p->n = left < SAGA_MLP_PAIRED ? left : SAGA_MLP_PAIRED;
        make_pairs(p, x + k, stride, points);
        if (layer->int8)
            add_products(p, layer->weight, at, stride, 1);
        else
            add_products(p, layer->weight, at, stride, 0);
    }
}

#endif
