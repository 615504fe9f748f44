/* SPDX-License-Identifier: MIT
 *
 * The networks QUERY and AGG, which blocks ask and tell the memory bank by:
 * what they are told of a block, and where their gradients go.
 */
#ifndef SAGA_BANK_BLOCKS_H
#define SAGA_BANK_BLOCKS_H

#include "bank_twin.h"

#define saga_bank_blocks_run SAGA_REAL_NAME(saga_bank_blocks_run)
#define saga_bank_blocks_backward SAGA_REAL_NAME(saga_bank_blocks_backward)

/* Runs QUERY or AGG on the blocks of order first .. end - 1. */
void saga_bank_blocks_run(saga_twin_batch *b, const saga_bank_twin_input *in,
                          int net, size_t first, size_t end);

/* Goes back through all blocks, from b->d_out: adds to d's network and to
 * dx. */
void saga_bank_blocks_backward(saga_scene *d, const saga_rate_features *dx,
                               saga_twin_batch *b,
                               const saga_bank_twin_input *in, int net);

#endif
