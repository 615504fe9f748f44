/* SPDX-License-Identifier: MIT
 *
 * The positional embedding is sine and cosine of 2^k quarter turns per unit of
 * each coordinate, k = 0..octaves-1 (norm: Geometry of the scaffold). The unit
 * is the half-cube, half the segment, or the half-size an offset is relative
 * to.
 */
#ifndef SAGA_EMBEDDING_H
#define SAGA_EMBEDDING_H

#include "real.h"

#include <stddef.h>

#define saga_embedding_forward SAGA_REAL_NAME(saga_embedding_forward)

/* Sets y[i * stride + 2 * (octaves * axis + k)] = sine, + 1 = cosine, of
 * u[i * n_axes + axis]. stride >= 2 * octaves * n_axes lets it write into a
 * longer input vector. |2^k u| < 2^20. */
void saga_embedding_forward(real *y, size_t stride, const real *u, size_t m,
                            int n_axes, int octaves);

#endif
