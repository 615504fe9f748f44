/* SPDX-License-Identifier: MIT
 *
 * Products of matrices for dense layers over batches of points. Matrices are
 * row-major; what is called `padded` has rows of a whole number of vectors,
 * saga_dense_pad(n) reals, the excess zero.
 */
#ifndef SAGA_DENSE_H
#define SAGA_DENSE_H

#include "real.h"

#include <stddef.h>

#define saga_dense_pad SAGA_REAL_NAME(saga_dense_pad)
#define saga_dense_forward SAGA_REAL_NAME(saga_dense_forward)
#define saga_dense_backward SAGA_REAL_NAME(saga_dense_backward)
#define saga_dense_bias_backward SAGA_REAL_NAME(saga_dense_bias_backward)

size_t saga_dense_pad(size_t n);

/* y[n][pad(n_out)] = bias + x[n][x_stride] w[n_in][pad(n_out)], w and bias
 * padded; bias NULL: 0; relu: negative values become 0. The sum over n_in runs
 * in its order, whatever n is. With the transposed weights this is also the
 * backward pass to the input. */
void saga_dense_forward(real *y, const real *x, size_t x_stride, const real *w,
                        const real *bias, size_t n, size_t n_in, size_t n_out,
                        int relu);

/* dw[n_out][pad(n_in)] += dy[n][dy_stride]^T x[n][pad(n_in)]; in chunks of 64
 * points, each summed in order. */
void saga_dense_backward(real *dw, const real *dy, size_t dy_stride,
                         const real *x, size_t n, size_t n_in, size_t n_out);

/* db[n_out] += sums over the points of dy[n][dy_stride], in order. */
void saga_dense_bias_backward(real *db, const real *dy, size_t dy_stride,
                              size_t n, size_t n_out);

#endif
