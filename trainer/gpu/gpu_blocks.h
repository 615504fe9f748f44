/* SPDX-License-Identifier: MIT
 *
 * Adam for blocks (nn/block_adam.h) on a device, where the optimiser's state
 * and the blocks stay from one step to the next.
 */
#ifndef SAGA_GPU_BLOCKS_H
#define SAGA_GPU_BLOCKS_H

#include "block_adam.h"
#include "compute.h"

typedef struct saga_gpu_blocks saga_gpu_blocks;

/* Tells whether the device can have the state of n blocks in a buffer. */
bool saga_gpu_has_blocks(const saga_gpu *gpu, size_t n, size_t width);

/* Returns an optimiser without blocks, or NULL with *error set. The device must
 * outlive it. */
saga_gpu_blocks *saga_gpu_blocks_new(saga_gpu *gpu, saga_error *error);
void saga_gpu_blocks_free(saga_gpu_blocks *blocks);

/* Copy numbers, spans and state to the device, and the state back into an
 * optimiser of the same size. Return false with *error set if the device's
 * memory is short or it is lost; then what was there before stays on the host.
 */
bool saga_gpu_blocks_put(saga_gpu_blocks *blocks, const saga_block_adam *b,
                         saga_error *error);
bool saga_gpu_blocks_get(saga_gpu_blocks *blocks, const saga_block_adam *b,
                         saga_error *error);

/* As saga_block_adam_update, with the gradients b->g of the host, for blocks
 * that were put; brings b->x back. Returns false with *error set also if a
 * number is not finite. */
bool saga_gpu_blocks_step(saga_gpu_blocks *blocks, const saga_block_adam *b,
                          const saga_adam *adam, uint64_t step,
                          saga_error *error);

/* --- Parts of a step, whose gradients are on the device ------------------- */

/* Makes room for a step, before commands are recorded. Then commands: begin
 * precedes all that may raise the flag; record does the step with gradients
 * (blocks, stride), unless the word at byte `at` of a buffer, which may be
 * NULL, is not 0; and fetch copies the blocks. After the list, are_sound tells
 * whether all numbers were finite, and take sets b->x to what was fetched. */
bool saga_gpu_blocks_room(saga_gpu_blocks *blocks, const saga_block_adam *b,
                          saga_error *error);
void saga_gpu_blocks_begin(saga_gpu_blocks *blocks,
                           const saga_gpu_buffer *unless, size_t at);
void saga_gpu_blocks_record(saga_gpu_blocks *blocks, const saga_block_adam *b,
                            const saga_adam *adam, uint64_t step,
                            const saga_gpu_buffer *gradients);
void saga_gpu_blocks_fetch(saga_gpu_blocks *blocks, const saga_block_adam *b);
bool saga_gpu_blocks_are_sound(const saga_gpu_blocks *blocks, uint64_t step,
                               saga_error *error);
void saga_gpu_blocks_take(const saga_gpu_blocks *blocks,
                          const saga_block_adam *b);

/* Return the blocks (blocks, stride), and two words: kernels may set the first
 * to 1, and do no step if the second is not 0. */
const saga_gpu_buffer *saga_gpu_blocks_rows(const saga_gpu_blocks *blocks);
const saga_gpu_buffer *saga_gpu_blocks_flag(const saga_gpu_blocks *blocks);

/* Brings b->x back. */
bool saga_gpu_blocks_look(saga_gpu_blocks *blocks, const saga_block_adam *b,
                          saga_error *error);

/* Makes what all these need, for a plan (gpu_splat.h): of b only n, width and
 * stride count. */
bool saga_gpu_blocks_plan(saga_gpu_blocks *blocks, const saga_block_adam *b,
                          saga_error *error);

#endif
