/* SPDX-License-Identifier: MIT
 *
 * The networks QUERY and AGG of the memory bank, for many blocks at once. QUERY
 * makes the vector with which a block reads the bank, AGG the token that a
 * decoded block writes to it. This file sets their inputs and distributes their
 * gradients.
 */
#ifndef SAGA_BANK_BLOCKS_H
#define SAGA_BANK_BLOCKS_H

#include "bank_twin.h"

#define saga_bank_blocks_run SAGA_REAL_NAME(saga_bank_blocks_run)
#define saga_bank_blocks_backward SAGA_REAL_NAME(saga_bank_blocks_backward)

/* Runs QUERY or AGG on blocks first .. end - 1 in the order of coding. */
void saga_bank_blocks_run(saga_twin_batch *b, const saga_bank_twin_input *in,
                          int net, size_t first, size_t end);

/* Goes back through all blocks from b->d_out, and adds the gradients of the
 * network to d and those of its inputs to dx. */
void saga_bank_blocks_backward(saga_scene *d, const saga_rate_features *dx,
                               saga_twin_batch *b,
                               const saga_bank_twin_input *in, int net);

#endif
