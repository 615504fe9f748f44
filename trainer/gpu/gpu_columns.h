/* SPDX-License-Identifier: MIT
 *
 * Columns of a network's inputs on a device, which blocks or positions give,
 * and their gradients.
 */
#ifndef SAGA_GPU_COLUMNS_H
#define SAGA_GPU_COLUMNS_H

#include "gpu_state.h"

/* Columns at .. at + n - 1 of n_rows rows of `dim` inputs. Row r is for block
 * first + every r. Inputs are clamped to +-most. */
typedef struct saga_gpu_columns {
    uint32_t n_rows, n, dim, at, first, every;
    real most;
} saga_gpu_columns;

/* Record columns of buffer x: embeddings of positions (blocks, 4); or rows of
 * `from` (blocks, have), interpolated by the set of links, or the block's own
 * if that is -1. With fewer numbers than columns the rest is 0. */
void saga_gpu_embed(saga_gpu_canvas *g, const saga_gpu_columns *c, int position,
                    int x);
void saga_gpu_gather(saga_gpu_canvas *g, const saga_gpu_columns *c, int from,
                     uint32_t have, int links, int x);

/* Where gradients go back to: rows of buffer `to` (n_blocks, n), which are set
 * or added to. */
typedef struct saga_gpu_target {
    int to;
    uint32_t n_blocks;
    int links;
    bool adds;
} saga_gpu_target;

/* Records the way back of the gradients d_x of columns of x. */
void saga_gpu_scatter(saga_gpu_canvas *g, const saga_gpu_columns *c, int x,
                      int d_x, const saga_gpu_target *t);

#endif
