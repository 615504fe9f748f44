/* SPDX-License-Identifier: MIT
 *
 * A checkpoint's header says what its training was asked for and where it
 * stands. It comes first in the file, so that a reader can refuse a checkpoint
 * before it looks at the rest.
 */
#ifndef SAGA_SAVE_HEADER_H
#define SAGA_SAVE_HEADER_H

#include "train_state.h"

/* Each has eight bytes, so that there is no padding. */
typedef struct {
    uint64_t primitives, coarse, fine, warm, render, level, seed;
    uint64_t motion, capture, segments, first, turn, n_bytes, n_finished;
    uint64_t views, base_why, base_still, base_looked_at, base_prim, base_kept;
    uint64_t layers, teachers;
    uint64_t only;               /* the segment in training, if it has networks
                                  * of another training; else its number of
                                  * segments */
    char ablate[128];
    double lambda, chosen_lambda, base_saved, n_pixels;
    uint64_t stage, fitting, dynamic, tools;
    double explained, changing, recent_mse;
    struct { double worth, cost; uint64_t asked, kept; }
        tool[SAGA_TRAIN_N_TOOLS];
} saga_train_header;

void saga_train_header_fill(saga_train_header *h, const saga_train *t);
/* Reads a header and fails where its numbers are impossible. */
void saga_train_header_walk(saga_train_header *h, saga_checkpoint *c);

/* Tell whether a header could be of any training. */
bool saga_train_header_iterations(const saga_train_header *h);
bool saga_train_header_turns(const saga_train_header *h);

/* Compare a header with what t was asked for, all but the pictures. `file` is
 * named in the error. */
bool saga_train_header_fits(const saga_train *t, const saga_train_header *h,
                            const char *file, saga_error *error);
bool saga_train_header_segments(const saga_train *t,
                                const saga_train_header *h, const char *file,
                                saga_error *error);

/* Gives the options that a checkpoint's training was begun with, or came to;
 * false where they are impossible. They point into h. */
bool saga_train_header_options(saga_train_options *o,
                               const saga_train_header *h);

/* save.c: reads all behind the cameras. */
bool saga_train_load_state(saga_train *t, const saga_train_header *h,
                           saga_checkpoint *c, saga_error *error);

#endif
