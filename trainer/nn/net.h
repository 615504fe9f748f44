/* SPDX-License-Identifier: MIT
 *
 * Networks of dense layers with ReLU after each layer except the last, over
 * batches of points: x (M, dim[0]) -> y (M, dim[n_layers]).
 *
 * Results do not depend on the number of threads: points are divided into
 * blocks by their number only, each block sums its gradients, and the sums of
 * the blocks are added in order.
 */
#ifndef SAGA_NET_H
#define SAGA_NET_H

#include "error.h"
#include "real.h"
#include "threads.h"

#include <stddef.h>

enum { SAGA_NET_LAYERS = 4 };

/* The weights of a network, or their gradients, or the moments of an
 * optimiser. */
typedef struct saga_net {
    int n_layers;                 /* 1..SAGA_NET_LAYERS */
    int dim[SAGA_NET_LAYERS + 1]; /* >= 1 */
    real *w[SAGA_NET_LAYERS];     /* (dim[l + 1], dim[l]) */
    real *b[SAGA_NET_LAYERS];     /* (dim[l + 1]) */
} saga_net;

/* The memory of a network: data that a forward pass keeps for its backward
 * pass, and scratch. It is all zero or set by saga_net_reserve, and freed by
 * saga_net_free. */
typedef struct saga_net_work {
    size_t n_points, n_threads;    /* the most that it has room for */
    real *hidden[SAGA_NET_LAYERS]; /* (M, padded), after ReLU */
    real *packed;                  /* the weights, transposed and not */
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
#define saga_net_block_chunks SAGA_REAL_NAME(saga_net_block_chunks)
#define saga_net_block_begin SAGA_REAL_NAME(saga_net_block_begin)
#define saga_net_dy SAGA_REAL_NAME(saga_net_dy)
#define saga_net_chunk_backward SAGA_REAL_NAME(saga_net_chunk_backward)
#define saga_net_n_sums SAGA_REAL_NAME(saga_net_n_sums)
#define saga_net_add_sum SAGA_REAL_NAME(saga_net_add_sum)
#define saga_net_ns SAGA_REAL_NAME(saga_net_ns)
#define saga_net_sums_ns SAGA_REAL_NAME(saga_net_sums_ns)
#define saga_net_forward SAGA_REAL_NAME(saga_net_forward)
#define saga_net_backward SAGA_REAL_NAME(saga_net_backward)

/* Returns the number of weights and biases. */
size_t saga_net_n_params(const saga_net *net);

/* Points w and b into params (n_params), in the order w[0], b[0], w[1], ... */
void saga_net_bind(saga_net *net, real *params);

/* Initialises by He's method: uniform weights of variance 2 / dim[l]
 * (1 / dim[l] in the last layer), and biases of 0. */
void saga_net_init(saga_net *net, unsigned long long seed);

/* Allocates memory for up to m points through networks whose layers are no
 * larger than those of net, with the present number of threads. Returns false
 * with *error set, and nothing to free, if memory is short. */
bool saga_net_reserve(saga_net_work *work, const saga_net *net, size_t m,
                      saga_error *error);
void saga_net_free(saga_net_work *work);

/* A pass over points, forward, x to y, or backward, from the gradients of y to
 * those of x and of the weights. Inputs that are constants need no gradient.
 * Where inputs are the outputs of a ReLU, its inputs' gradients are meant. */
typedef struct saga_net_pass {
    const saga_net *net;
    saga_net_work *work;
    const real *x; /* (M, dim[0]) */
    real *y;       /* (M, dim[n_layers]); not used backward */
    size_t m;      /* number of points */
    bool x_is_constant, x_is_rectified;
} saga_net_pass;

/* Gradients of the points of a chunk, a row for each, `stride` reals apart. */
typedef struct saga_net_rows {
    real *at;
    size_t stride;
} saga_net_rows;

/* The number of points that go through all layers together. */
enum { SAGA_NET_CHUNK = 128 };

/* Steps of a pass, for callers that do other work on the same points, with
 * saga_parallel and at most work->n_threads threads. Forward: saga_net_begin,
 * then all chunks of SAGA_NET_CHUNK points. Backward: all blocks of the same
 * points, and then all sums. A thread begins a block and takes its chunks back
 * in order. dy has a row for each point of the chunk, `stride` reals apart, in
 * the caller's memory or in that of saga_net_dy. The gradients of the inputs,
 * NULL for constants, are in memory of the work that the thread's next chunk
 * uses again, so none of these need leave the cache. */
void saga_net_begin(const saga_net_pass *pass);
void saga_net_chunk_forward(const saga_net_pass *pass, size_t chunk);
size_t saga_net_n_blocks(size_t m);
saga_range saga_net_block_chunks(size_t m, size_t block);
void saga_net_block_begin(const saga_net_pass *pass, size_t block);
saga_net_rows saga_net_dy(const saga_net_pass *pass);
saga_net_rows saga_net_chunk_backward(const saga_net_pass *pass, size_t chunk,
                                      const real *dy, size_t stride);
size_t saga_net_n_sums(const saga_net *net);
void saga_net_add_sum(saga_net *d, const saga_net_pass *pass, size_t sum);

/* Returns about how many nanoseconds a point takes forward; backward takes
 * twice that. */
double saga_net_ns(const saga_net *net);

/* Returns about how many nanoseconds all sums of gradients take after m
 * points. */
double saga_net_sums_ns(const saga_net *net, size_t m);

/* Sets y (M, dim[n_layers]) to the outputs for x. */
void saga_net_forward(real *y, saga_net_work *work, const real *x, size_t m,
                      const saga_net *net);

/* Goes back through the last forward pass: SETS dx (M, dim[0]; may be NULL),
 * and ADDS to weights and biases of d. */
void saga_net_backward(real *dx, saga_net *d, saga_net_work *work,
                       const real *dy, const real *x, size_t m,
                       const saga_net *net);

#endif
