/* SPDX-License-Identifier: MIT
 *
 * Convolution and pooling of planes, for networks that judge pictures. Sums
 * have a fixed order, so that threads change nothing.
 */
#ifndef SAGA_CONV_H
#define SAGA_CONV_H

#include "error.h"

#include <stdbool.h>
#include <stddef.h>

enum { SAGA_CONV_GROUP = 4 }; /* output planes that are computed together */

/* Planes lie one after the other. free() frees v. */
typedef struct saga_planes {
    int n, height, width;
    float *v;                /* (n, height, width) */
} saga_planes;

/* A convolution's weights, in the order in which they are used. */
typedef struct saga_conv {
    int n_out, n_in, size;   /* size x size taps */
    int stride, pad;
    float *weight;           /* (n_out / GROUP, n_in * size * size, GROUP), with
                              * n_out rounded up, and zeros there */
    float *bias;             /* (n_out) */
} saga_conv;

/* Packs weights (n_out, n_in, size, size) and biases (n_out), which stay the
 * caller's; c comes with all sizes set. saga_conv_free frees the copy. */
bool saga_conv_pack(saga_conv *c, const double *weight, const double *bias,
                    saga_error *error);
void saga_conv_free(saga_conv *c);

/* out = max(0, bias + weight * in), with zeros around `in`. Allocates out->v,
 * or leaves it NULL: no memory, or *in is too small, which leaves no pixel and
 * no error. in->n must be c->n_in. */
bool saga_conv_run(saga_planes *out, const saga_conv *c, const saga_planes *in,
                   int n_threads, saga_error *error);

/* Takes the maxima of size x size windows, `stride` apart. A last window that
 * is not full counts if `ceil`. As above where there is none. */
bool saga_pool_max(saga_planes *out, const saga_planes *in, int size,
                   int stride, bool ceil, saga_error *error);

#endif
