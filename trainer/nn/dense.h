/* SPDX-License-Identifier: MIT
 *
 * Matrix products for dense layers over batches of points. Matrices are
 * row-major. Rows of a `padded` matrix have saga_dense_pad(n) reals, whole
 * vectors of every length; the excess is zero.
 */
#ifndef SAGA_DENSE_H
#define SAGA_DENSE_H

#include "isa.h"
#include "real.h"

#include <stddef.h>

#define saga_dense_forward SAGA_ISA_NAME(saga_dense_forward)
#define saga_dense_backward SAGA_ISA_NAME(saga_dense_backward)
#define saga_dense_bias_backward SAGA_ISA_NAME(saga_dense_bias_backward)

static inline size_t saga_dense_pad(size_t n)
{
    return (n + 7) / 8 * 8;
}

/* n rows of `width` reals, `stride` reals apart: inputs or gradients of n
 * points. */
typedef struct saga_dense_rows {
    const real *at;
    size_t n, width, stride;
} saga_dense_rows;

/* A layer with n_out outputs; relu = 1 sets negative outputs to 0. Backward
 * through a ReLU, an output is 0 where `active`, the result of that ReLU, is 0;
 * NULL: nowhere. */
typedef struct saga_dense {
    const real *w;    /* (n_in, pad(n_out)), padded */
    const real *bias; /* (pad(n_out)), padded; NULL: 0 */
    size_t n_out;
    int relu;
    const real *active; /* (n, pad(n_out)), padded */
} saga_dense;

/* Sets y (n, pad(n_out)) to bias + x w. The sum over the inputs is in their
 * order for any n. With transposed weights it is also the backward pass to the
 * input. */
extern void saga_dense_forward(real *y, const saga_dense *layer,
                               const saga_dense_rows *x);

/* Adds dy^T x over n points to dw (n_out, pad(n_in)). The width of dy is n_out;
 * the width of x is n_in and its stride pad(n_in). Sums are over chunks of 64
 * points, each in order. */
extern void saga_dense_backward(real *dw, const saga_dense_rows *dy,
                                const saga_dense_rows *x);

/* Adds to db (n_out) the sums of dy over the points, in order. */
extern void saga_dense_bias_backward(real *db, const saga_dense_rows *dy);

#endif
