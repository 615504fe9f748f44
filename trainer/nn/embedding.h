/* SPDX-License-Identifier: MIT
 *
 * The positional embedding has sine and cosine of 2^k quarter turns per unit of
 * each coordinate, k = 0..octaves-1 (docs/arithmetic.md: Geometry of the
 * scaffold). The unit is half the cube, half the segment, or the half-size to
 * which an offset is relative.
 */
#ifndef SAGA_EMBEDDING_H
#define SAGA_EMBEDDING_H

#include "isa.h"
#include "real.h"

#include <stddef.h>

#define saga_embedding_forward SAGA_ISA_NAME(saga_embedding_forward)

/* Sets y[i * stride + 2 * (octaves * axis + k)] to the sine, and the next
 * element to the cosine, of u[i * n_axes + axis].
 * stride >= 2 * octaves * n_axes; a larger one writes into a longer input
 * vector. |2^k u| < 2^20. */
extern void saga_embedding_forward(real *y, size_t stride, const real *u,
                                   size_t m, int n_axes, int octaves);

#endif
