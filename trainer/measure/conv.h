/* SPDX-License-Identifier: MIT
 *
 * Convolution and pooling of planes, for networks that judge pictures. Sums are
 * formed in a fixed order, so that the number of threads does not change the
 * result.
 */
#ifndef SAGA_CONV_H
#define SAGA_CONV_H

#include "isa.h"
#include "error.h"

#include <stdbool.h>
#include <stddef.h>

#define saga_conv_pack SAGA_ISA_NAME(saga_conv_pack)
#define saga_conv_free SAGA_ISA_NAME(saga_conv_free)
#define saga_conv_run SAGA_ISA_NAME(saga_conv_run)
#define saga_pool_max SAGA_ISA_NAME(saga_pool_max)

enum { SAGA_CONV_GROUP = 4 }; /* output planes computed together */

/* Planes lie one after the other in v, which is released with free(). */
typedef struct saga_planes {
    int n, height, width;
    float *v; /* (n, height, width) */
} saga_planes;

/* A convolution's weights, in the order in which they are used. */
typedef struct saga_conv {
    int n_out, n_in, size; /* size x size taps */
    int stride, pad;
    float *weight; /* (n_out / GROUP, n_in * size * size, GROUP), with
                    * n_out rounded up to a multiple of GROUP and
                    * padded with zeros */
    float *bias;   /* (n_out) */
} saga_conv;

/* Packs weights (n_out, n_in, size, size) and biases (n_out), which are copied.
 * The caller has set all sizes of c. saga_conv_free releases the copy. Fails if
 * memory is short. */
extern bool saga_conv_pack(saga_conv *c, const double *weight,
                           const double *bias, saga_error *error);
extern void saga_conv_free(saga_conv *c);

/* Computes out = max(0, bias + weight * in), where `in` is padded with zeros.
 * in->n must be c->n_in. Allocates out->v. Returns false with an error if
 * memory is short; returns true and leaves out->v NULL if *in is so small that
 * no pixel remains. */
extern bool saga_conv_run(saga_planes *out, const saga_conv *c,
                          const saga_planes *in, int n_threads,
                          saga_error *error);

/* Takes the maxima of size x size windows, `stride` apart. A last window that
 * is not full counts if `ceil`. Memory and pictures that are too small are
 * treated as in saga_conv_run. */
extern bool saga_pool_max(saga_planes *out, const saga_planes *in, int size,
                          int stride, bool ceil, saga_error *error);

#endif
