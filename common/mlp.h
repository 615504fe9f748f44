/* SPDX-License-Identifier: MIT
 *
 * Fixed-point dense layers: int16 activations, int8 or int16 weights, int32
 * sums. Paper: the shared coordinate-based INR decoders and entropy networks.
 */
#ifndef SAGA_MLP_H
#define SAGA_MLP_H

#include "mlp_layer.h"

#include <stddef.h>
#include <stdint.h>

/* Where the weight of a row and an input k < pad(n_in) stands among the
 * n_out * pad(n_in) of a layer: as suits the machine's vectors. */
size_t saga_mlp_weight_at(uint32_t n_in, uint32_t n_out, uint32_t row,
                          uint32_t k);

/* A row can never overflow:
 *     sum|w| * 32767 + |bias| + 2^(shift-1) < 2^31,  shift in 0..24
 * (shift 0 does not round and counts 0 for the power).
 * weight_abs_sum is sum|w|; returns 1 if valid. Every sum order then gives the
 * same int32, so SIMD equals scalar to the bit. */
int saga_mlp_row_is_valid(int64_t weight_abs_sum, int64_t bias, int shift);

/* sum[r] = inner product of x and row r of w (n_row, n), n a multiple of
 * SAGA_MLP_PAD; rows whose sums can overflow are the caller's fault. */
void saga_mlp_products(int32_t *sum, const int16_t *w, const int16_t *x,
                       uint32_t n, uint32_t n_row);

/* A layer on n points, whose results do not depend on n: points that run
 * together share what a layer costs besides its products.
 * x: (n, pad(n_in)), |x| <= 32767; values past n_in are multiplied by zero but
 * are read. y: (n, pad(n_out)), must not overlap x; values past n_out are left
 * alone. Each |y| <= 32767. */
void saga_mlp_layer(int16_t *y, const saga_layer *layer, const int16_t *x,
                    uint32_t n);

#ifdef SAGA_COUNT_MACS
/* Defined by the test that counts: called with n_in * n_out per layer,
 * times the points. */
extern void saga_count_macs(uint64_t n);
#endif

#endif
