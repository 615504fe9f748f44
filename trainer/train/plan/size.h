/* SPDX-License-Identifier: MIT
 *
 * A file of a given size: which step features have while it is rendered, and
 * how many primitives the segments after the first.
 */
#ifndef SAGA_SIZE_H
#define SAGA_SIZE_H

#include "base_choice.h"
#include "encode.h"
#include "options.h"

typedef struct saga_size_terms {
    const saga_train_options *options; /* n_bytes; 0: none was asked for */
    const saga_train_base *base;
    const saga_encode_sizes *sizes; /* of the file, if training ended now */
} saga_size_terms;

/* Returns the part of the rendering that is over if the coming iteration is a
 * moment at which the step is set; else 0. */
double saga_size_moment(int iteration, int n_render);

/* Returns by what to multiply the features' step, of n values, at that
 * moment. */
double saga_size_step(const saga_size_terms *t, double over, double n);

/* Returns the primitives of a segment beside the base, after n_done that are
 * finished and have n_finished: as planned, or where a size was asked for,
 * those that fill what the finished ones left of it. */
uint32_t saga_size_share(const saga_size_terms *t, int n_done,
                         uint64_t n_finished);

#endif
