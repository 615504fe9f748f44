/* SPDX-License-Identifier: MIT
 *
 * Networks of dense layers, ReLU after every layer but the last, over
 * batches of points: x (M, dim[0]) -> y (M, dim[n_layers]).
 *
 * The same bits for any number of threads: points are divided in blocks by
 * their number alone, each block sums its gradients, the blocks' sums are
 * added in order.
 */
#ifndef SAGA_NET_H
#define SAGA_NET_H

#include "error.h"
#include "real.h"
#include "threads.h"

#include <stddef.h>

enum { SAGA_NET_LAYERS = 4 };

/* A network has weights, or their gradients, or an optimiser's moments. */
typedef struct saga_net {
    int n_layers;                 /* 1..SAGA_NET_LAYERS */
    int dim[SAGA_NET_LAYERS + 1]; /* >= 1 */
    real *w[SAGA_NET_LAYERS];     /* (dim[l + 1], dim[l]) */
    real *b[SAGA_NET_LAYERS];     /* (dim[l + 1]) */
} saga_net;

/* It holds what a forward pass leaves for its backward pass, and scratch.
 * Zero, or saga_net_reserve; saga_net_free at the end. */
typedef struct saga_net_work {
    size_t n_points, n_threads;    /* at most */
    real *hidden[SAGA_NET_LAYERS]; /* (M, padded), after ReLU */
    real *packed;                  /* weights, transposed and as they are */
    real *chunk;                   /* scratch of each thread */
    real *partial;                 /* gradients of each block */
} saga_net_work;

#define saga_net_n_params SAGA_REAL_NAME(saga_net_n_params)
#define saga_net_bind SAGA_REAL_NAME(saga_net_bind)
#define saga_net_init SAGA_REAL_NAME(saga_net_init)
#define saga_net_reserve SAGA_REAL_NAME(saga_net_reserve)
#define saga_net_free SAGA_REAL_NAME(saga_net_free)
#define saga_net_begin SAGA_REAL_NAME(saga_net_begin)
#define saga_net_chunk_forward SAGA_REAL_NAME(saga_net_chunk_forward)
#define saga_net_n_blocks SAGA_REAL_NAME(saga_net_n_blocks)
#define saga_net_block SAGA_REAL_NAME(saga_net_block)
#define saga_net_block_backward SAGA_REAL_NAME(saga_net_block_backward)
#define saga_net_n_sums SAGA_REAL_NAME(saga_net_n_sums)
#define saga_net_add_sum SAGA_REAL_NAME(saga_net_add_sum)
#define saga_net_ns SAGA_REAL_NAME(saga_net_ns)
#define saga_net_sums_ns SAGA_REAL_NAME(saga_net_sums_ns)
#define saga_net_forward SAGA_REAL_NAME(saga_net_forward)
#define saga_net_backward SAGA_REAL_NAME(saga_net_backward)

/* Returns the reals of all weights and biases. */
size_t saga_net_n_params(const saga_net *net);

/* Points w and b into params[n_params]: w[0], b[0], w[1], ... */
void saga_net_bind(saga_net *net, real *params);

/* Initialises as He does: uniform weights of variance 2 / dim[l]
 * (1 / dim[l] in the last layer), biases 0. */
void saga_net_init(saga_net *net, unsigned long long seed);

/* Reserves memory for up to m points through networks no larger than this one,
 * layer by layer, with as many threads as there may be now. False: nothing is
 * to be freed. */
bool saga_net_reserve(saga_net_work *work, const saga_net *net, size_t m,
                      saga_error *error);
void saga_net_free(saga_net_work *work);

/* A pass goes through points: forward y from x, back from dy to dx (NULL: not
 * wanted) and to the weights. The other pointers are not read or written. */
typedef struct saga_net_pass {
    const saga_net *net;
    saga_net_work *work;
    const real *x, *dy;          /* (M, dim[0]), (M, dim[n_layers]) */
    real *y, *dx;
    size_t m;                    /* points */
} saga_net_pass;

/* This number of points goes through all layers together. */
enum { SAGA_NET_CHUNK = 128 };

/* For those who do more with points than a network, a part at a time, in
 * several threads (saga_parallel, with at most work->n_threads): begin, then
 * all chunks of SAGA_NET_CHUNK points; later the blocks of the same points, in
 * which they go back, and then all of the blocks' sums. */
void saga_net_begin(const saga_net_pass *pass);
void saga_net_chunk_forward(const saga_net_pass *pass, size_t chunk);
size_t saga_net_n_blocks(size_t m);
saga_range saga_net_block(size_t m, size_t block);
void saga_net_block_backward(const saga_net_pass *pass, size_t block);
size_t saga_net_n_sums(const saga_net *net);
void saga_net_add_sum(saga_net *d, const saga_net_pass *pass, size_t sum);

/* Returns about the nanoseconds that a thread takes for a point forward; twice
 * that back. */
double saga_net_ns(const saga_net *net);

/* Returns the same of adding the sums of m points. */
double saga_net_sums_ns(const saga_net *net, size_t m);

/* Sets y (M, dim[n_layers]). */
void saga_net_forward(real *y, saga_net_work *work, const real *x, size_t m,
                      const saga_net *net);

/* Goes back through the same forward pass: SETS dx (M, dim[0]; NULL: not
 * wanted), ADDS to d's weights and biases. */
void saga_net_backward(real *dx, saga_net *d, saga_net_work *work,
                       const real *dy, const real *x, size_t m,
                       const saga_net *net);

#endif
