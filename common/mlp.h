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

/* Returns the index of the weight of a row and an input k < pad(n_in) among the
 * n_out * pad(n_in) weights of a layer. The order suits the machine's SIMD. */
size_t saga_mlp_weight_at(uint32_t n_in, uint32_t n_out, uint32_t row,
                          uint32_t k);

/* Returns 1 if a row cannot overflow:
 *     sum|w| * 32767 + |bias| + 2^(shift-1) < 2^31,  shift in 0..24,
 * where the power is 0 for shift 0. weight_abs_sum is sum|w|. For such a row
 * every order of summation gives the same int32, so that SIMD and scalar code
 * are equal to the bit. */
int saga_mlp_row_is_valid(int64_t weight_abs_sum, int64_t bias, int shift);

/* Sets sum[r] to the inner product of x and row r of w (n_row, n), where n is a
 * multiple of SAGA_MLP_PAD. The caller makes sure that no sum overflows. */
void saga_mlp_products(int32_t *sum, const int16_t *w, const int16_t *x,
                       uint32_t n, uint32_t n_row);

/* Runs a layer on n points. The results do not depend on n; running several
 * points together saves time.
 * x: (n, pad(n_in)), |x| <= 32767; values past n_in are read, but multiplied by
 * zero. y: (n, pad(n_out)) must not overlap x; values past n_out are not
 * written. Each |y| <= 32767. */
void saga_mlp_layer(int16_t *y, const saga_layer *layer, const int16_t *x,
                    uint32_t n);

#ifdef SAGA_COUNT_MACS
/* Defined by a test that counts multiply-accumulates. Each run of a layer calls
 * it with n_in * n_out times the number of points. */
extern void saga_count_macs(uint64_t n);
#endif

#endif
