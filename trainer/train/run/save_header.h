/* SPDX-License-Identifier: MIT
 *
 * The header of a checkpoint holds the options of the training and its state.
 * It comes first in the file, so that a reader can refuse a checkpoint before
 * it reads the rest.
 */
#ifndef SAGA_SAVE_HEADER_H
#define SAGA_SAVE_HEADER_H

#include "train_state.h"

/* All members are multiples of eight bytes, so there is no padding. */
typedef struct {
    uint64_t primitives, coarse, fine, warm, render, level, seed;
    uint64_t motion, capture, segments, first, turn, n_bytes, n_finished;
    uint64_t views, base_why, base_still, base_looked_at, base_prim, base_kept;
    uint64_t layers, teachers, paper;
    uint64_t isa;  /* saga_isa_same of the level that computed it */
    uint64_t only; /* the segment in training, if its networks are
                    * from another training; otherwise n_segments
                    * of the options, which is no segment */
    char ablate[128];
    double lambda, chosen_lambda, base_saved, n_pixels;
    uint64_t stage, fitting, dynamic, tools;
    double explained, changing, recent_mse;
    struct {
        double worth, cost;
        uint64_t asked, kept;
    } tool[SAGA_TRAIN_N_TOOLS];
} saga_train_header;

void saga_train_header_fill(saga_train_header *h, const saga_train *t);
/* Reads a header from a checkpoint, and marks the checkpoint as failed if a
 * number is impossible. */
void saga_train_header_walk(saga_train_header *h, saga_checkpoint *c);

/* Tells whether a training can be at the header's stage: there is a fit from
 * the rendering stage on, and nothing is saved behind the last stage but
 * networks. */
bool saga_train_header_stage(const saga_train_header *h);

/* Tells whether the model of the file is decided, by which time some options
 * cannot change any more. */
bool saga_train_header_settled(const saga_train_header *h);

/* Compare a header with the options of t, except for the pictures. Return false
 * with *error set, which names `file`, if one differs. */
bool saga_train_header_fits(const saga_train *t, const saga_train_header *h,
                            const char *file, saga_error *error);
bool saga_train_header_segments(const saga_train *t, const saga_train_header *h,
                                const char *file, saga_error *error);

/* Sets *o to the options that a checkpoint's training was begun with, or
 * arrived at. Returns false if they are impossible. Strings in *o point into
 * *h. */
bool saga_train_header_options(saga_train_options *o,
                               const saga_train_header *h);

/* save.c: reads everything that follows the cameras in a checkpoint. */
bool saga_train_load_state(saga_train *t, const saga_train_header *h,
                           saga_checkpoint *c, saga_error *error);

#endif
