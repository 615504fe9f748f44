/* SPDX-License-Identifier: MIT
 *
 * Steers a training to a file of a given size, by the step of its features
 * while it is rendered, and by the number of primitives of the segments after
 * the first.
 */
#ifndef SAGA_SIZE_H
#define SAGA_SIZE_H

#include "base_choice.h"
#include "encode.h"
#include "options.h"

typedef struct saga_size_terms {
    const saga_train_options *options; /* n_bytes: the size wanted; 0: none */
    const saga_train_base *base;
    uint32_t room;                  /* as in base_choice.h */
    const saga_encode_sizes *sizes; /* sizes of the file if training ended
                                     * now */
} saga_size_terms;

/* Returns the part of the rendering stage that is done, in 0..1, if the step is
 * to be set before this iteration; otherwise 0. */
double saga_size_moment(int iteration, int n_render);

/* Returns the factor for the step of the features at that moment. n: number of
 * feature values. */
double saga_size_step(const saga_size_terms *t, double over, double n);

/* Returns the number of primitives of the next segment, without the base.
 * n_done: number of segments that are finished; n_finished: number of their
 * primitives. Without a size it is the planned number, with one as many as the
 * remaining bytes pay for. */
uint32_t saga_size_share(const saga_size_terms *t, int n_done,
                         uint64_t n_finished);

#endif
