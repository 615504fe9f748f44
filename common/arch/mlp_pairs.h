/* SPDX-License-Identifier: MIT
 *
 * Inner products of two points at a time in words of 64 bits. mlp.c includes
 * this file on 64-bit machines without vectors; the results are those of its
 * plain loops, bit for bit.
 *
 * A word holds the activations x and y of two points as x + 2^32 y. Multiplied
 * by a weight, it gives the products of both points, and adding up such words
 * gives both sums, all modulo 2^64. While sums grow, a negative lower half
 * borrows from the upper half. The final word is s + 2^32 t. Since neither sum
 * overflows 32 bits (saga_mlp_row_is_valid), s is its lower half and t is
 * (word - s) / 2^32. Long rows are summed in pieces: sums that were split after
 * one piece are joined to the same word before the next.
 */
#ifndef SAGA_MLP_PAIRS_H
#define SAGA_MLP_PAIRS_H

#include "mlp_layer.h"

#include <stddef.h>
#include <stdint.h>

#define SAGA_MLP_PAIRED 32u

/* The sums of some rows for two points. The 512 bytes of stack limit the number
 * of rows. */
typedef struct {
    int32_t sum[2][SAGA_MLP_PAIRED]; /* sums of each point, by rows */
    uint32_t n_row;
    uint32_t n;
    uint64_t pair[SAGA_MLP_PAIRED]; /* joined sums of n inputs at a time */
} saga_pairs;

/* Joins the activations of x, (points, stride), to words. The upper halves are
 * 0 if there is only one point. */
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

/* Adds the products of the pairs and the weights to the sums. The weights begin
 * at w[at] in the first row and `stride` later in each further row. Four rows
 * at a time share every load of a pair. The function is inlined, so that `int8`
 * is a constant. */
static inline __attribute__((always_inline)) void
add_products(saga_pairs *p, const void *w, size_t at, size_t stride, int int8)
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

/* Sets p->sum to the inner products of one or two points x, (points,
 * pad(n_in)), and p->n_row rows from `row` on. Weights are stored row by row.
 */
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
