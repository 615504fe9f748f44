/* SPDX-License-Identifier: MIT
 *
 * Products of matrices for dense layers over batches of points.
 * Matrices are row-major; what is called `padded` has rows of a whole number of
 * vectors, saga_dense_pad(n) reals, the excess zero.
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

/* n rows have `width` reals each, a stride apart: what goes in or comes back
 * for n points. */
typedef struct saga_dense_rows {
    const real *at;
    size_t n, width, stride;
} saga_dense_rows;

/* Runs a layer of width n_out; with relu negative values become 0. */
typedef struct saga_dense {
    const real *w;               /* [n_in][pad(n_out)], padded */
    const real *bias;            /* [pad(n_out)], padded; NULL: 0 */
    size_t n_out;
    int relu;
} saga_dense;

/* Computes y[n][pad(n_out)] = bias + x w. The sum over x's width runs in its
 * order, whatever n is. With the transposed weights this is also the backward
 * pass to the input. */
void saga_dense_forward(real *y, const saga_dense *layer,
                        const saga_dense_rows *x);

/* Adds to dw[n_out][pad(n_in)] dy^T x, of n points; dy's width is n_out, x's
 * n_in and its stride pad(n_in). In chunks of 64 points, each summed in
 * order. */
void saga_dense_backward(real *dw, const saga_dense_rows *dy,
                         const saga_dense_rows *x);

/* Adds to db[n_out] the sums over the points of dy, in order. */
void saga_dense_bias_backward(real *db, const saga_dense_rows *dy);

#endif
