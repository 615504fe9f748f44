/* SPDX-License-Identifier: MIT
 *
 * Kernel interpolation of anchor features with given neighbours: the float
 * twin of common/interp.*.
 *   u = (query - source) / (l_query + l_source) per axis,
 *   d = min(16, u_x^2 + u_y^2 + u_z^2 + lambda_t u_t^2),
 *   w = softmax(-d / T),   out = sum of w f.
 */
#ifndef SAGA_KERNEL_INTERP_H
#define SAGA_KERNEL_INTERP_H

#include "real.h"

#include <stddef.h>
#include <stdint.h>

enum { SAGA_KERNEL_NEIGHBOURS = 32 }; /* most per query */

/* Who interpolates from whom: the integer path decides, the trainer keeps it
 * for some iterations. */
typedef struct saga_kernel {
    size_t n_queries, n_sources;
    int n_features;
    int max_neighbours;      /* K <= SAGA_KERNEL_NEIGHBOURS */
    const uint32_t *index;   /* (M, K) sources of each query */
    const uint32_t *count;   /* (M) how many, 0..K; 0: the result is zero */
    real temperature;        /* T > 0 */
    real lambda_t;           /* 0: time does not count */
} saga_kernel;

/* Values, or gradients. As gradients, NULL members are not computed. */
typedef struct saga_kernel_values {
    real *feature;           /* (B, F) */
    real *source;            /* (B, 4) x, y, z, t */
    real *source_support;    /* (B, 4), > 0 */
    real *query;             /* (M, 4) */
    real *query_support;     /* (M, 4), > 0 */
} saga_kernel_values;

/* The lists seen from the sources, and scratch. Zero it first. */
typedef struct saga_kernel_work {
    uint32_t *begin;         /* (B + 1) */
    uint32_t *entry;         /* query * K + place, by source, then by entry */
    real *weight;            /* (M, K) of the forward pass */
    real *d_distance;        /* (M, K) */
    size_t cap[4];
} saga_kernel_work;

#define saga_kernel_free SAGA_REAL_NAME(saga_kernel_free)
#define saga_kernel_link SAGA_REAL_NAME(saga_kernel_link)
#define saga_kernel_forward SAGA_REAL_NAME(saga_kernel_forward)
#define saga_kernel_backward SAGA_REAL_NAME(saga_kernel_backward)

void saga_kernel_free(saga_kernel_work *work);

/* Once after index or count changed. M * K < 2^32. Returns 0, or -1 without
 * memory. */
int saga_kernel_link(saga_kernel_work *work, const saga_kernel *k);

/* Sets out (M, F) and work->weight. */
void saga_kernel_forward(real *out, saga_kernel_work *work,
                         const saga_kernel_values *v, const saga_kernel *k);

/* Adds to d's members that are not NULL. */
void saga_kernel_backward(saga_kernel_values *d, saga_kernel_work *work,
                          const real *d_out, const saga_kernel_values *v,
                          const saga_kernel *k);

#endif
