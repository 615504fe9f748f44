/* SPDX-License-Identifier: MIT
 *
 * The description of a dense layer that the kernels of mlp.c and of arch/ read.
 */
#ifndef SAGA_MLP_LAYER_H
#define SAGA_MLP_LAYER_H

#include "cpu.h"

#include <stdint.h>

/* Rows of weights are padded with zeros to this multiple, so that the inner
 * product is a whole number of vectors. */
#define SAGA_MLP_PAD 16u

static inline uint32_t saga_mlp_pad(uint32_t n)
{
    return (n + SAGA_MLP_PAD - 1) & ~(SAGA_MLP_PAD - 1);
}

/* One layer: y = relu?(sat16(fx_rshift(bias + W x, shift))) row by row. */
typedef struct saga_layer {
    const void *weight;   /* n_out * pad(n_in) int8_t or int16_t, placed by
                           * saga_mlp_weight_at, zero in the padding;
                           * aligned to 16 */
    const int32_t *bias;  /* (n_out) at input Q + weight Q */
    const uint8_t *shift; /* (n_out), 0..24 */
    uint16_t n_in, n_out; /* n_in may be 0 (bias only): weight and x are not
                           * read then, but are not NULL either */
    uint8_t int8;         /* weights are int8_t */
    uint8_t relu;
    saga_cpu cpu; /* the machine has it */
} saga_layer;

/* mlp_avx2.c compiles the tiles of mlp_x86.h for AVX2, for machines that turn
 * out to have it although the compiler may not assume it. */
#if defined SAGA_MAY_AVX2 && !defined __AVX2__ && \
    (defined __clang__ || __GNUC__ >= 12)
#define SAGA_MLP_MAY_AVX2
uint32_t saga_mlp_tiles__avx2(int16_t *y, const saga_layer *layer,
                              const int16_t *x, uint32_t n);
#endif

#endif
