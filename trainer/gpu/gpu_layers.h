/* SPDX-License-Identifier: MIT
 *
 * Dense layers on a device, over the rows of a canvas's buffers. They are
 * listed once for a pass; forward they run in the order of the list, and
 * backward in the other. Layer i of a list has its outputs in buffer
 * GPU_LAYER + i and their gradients in GPU_D_LAYER + i, unless its owner says
 * otherwise. All parameters are in GPU_PARAM, their gradients in GPU_D_PARAM.
 */
#ifndef SAGA_GPU_LAYERS_H
#define SAGA_GPU_LAYERS_H

#include "gpu_state.h"
#include "gpu_ways.h"
#include "net.h"

/* dense.glsl */
enum { SAGA_GPU_RELU = 1, SAGA_GPU_ADD = 2 };

/* A layer, by its buffers. d_x is -1 if the inputs need no gradients. A layer
 * without inputs gives its biases. */
typedef struct saga_gpu_layer {
    int x, y, d_y, d_x;
    uint32_t n_in, n_out, at, how, how_back, n_cols;
} saga_gpu_layer;

typedef struct saga_gpu_layers {
    saga_gpu_layer list[SAGA_GPU_MOST_LAYERS];
    int n;
    int first;     /* of the buffers that they have */
    uint32_t base; /* where their parameters begin */
    uint32_t n_params;
    uint32_t n_rows, slab, n_slabs;
} saga_gpu_layers;

/* Returns an empty list for passes over n_rows rows. */
saga_gpu_layers saga_gpu_layers_of(uint32_t n_rows, int first, uint32_t base);

/* Appends the layers of a network, the first of them with the x, d_x, how,
 * how_back and n_cols of `first`. */
void saga_gpu_layers_append(saga_gpu_layers *s, const saga_net *net,
                            saga_gpu_layer first);

/* Appends the sums of the columns of buffer y (rows, n): as if they were the
 * gradients of a layer's biases, which are not used. */
void saga_gpu_layers_append_sums(saga_gpu_layers *s, int y, uint32_t n);

/* Tells whether the device can have gradients of so many parameters. */
bool saga_gpu_layers_fit(const saga_gpu *gpu, size_t n_params);

/* Makes room for what layers compute; parameters are their owner's. */
bool saga_gpu_layers_room(saga_gpu_canvas *g, const saga_gpu_layers *s,
                          const char *what, saga_error *error);

/* Record layers from .. to - 1, forward or backward, and then the sums of the
 * gradients of all parameters. */
void saga_gpu_layers_forward(saga_gpu_canvas *g, const saga_gpu_layers *s,
                             int from, int to);
void saga_gpu_layers_backward(saga_gpu_canvas *g, const saga_gpu_layers *s,
                              int from, int to);
void saga_gpu_layers_sum(saga_gpu_canvas *g, const saga_gpu_layers *s);

/* Appends the ways of a network's parameters and of their gradients, which are
 * from *at on in the buffers, and moves *at to what follows. */
void saga_gpu_layers_ways(saga_gpu_ways *ways, size_t *at, const saga_net *net,
                          const saga_net *d);

#endif
