/* SPDX-License-Identifier: MIT
 *
 * Trainings that take a tenth of a second: the built-in room in a few thousand
 * pixels, and what becomes of it. What fails, fails the test.
 */
#ifndef TINY_TRAINING_H
#define TINY_TRAINING_H

#include "synth_capture.h"
#include "train.h"

enum { TINY_WARM = 40, TINY_RENDER = 60 };

/* A capture, and a place for the checkpoint of its training, in a folder that
 * tiny_close removes. */
typedef struct tiny {
    char folder[64], checkpoint[80];
    saga_capture capture;
} tiny;

/* The room in 64 x 36 pixels, of four cameras, of which one is held out. */
void tiny_open(tiny *t, int n_frames);
void tiny_close(tiny *t);

/* One of them for all tests of the program. */
#define TINY_GROUP(name, n_frames) \
    static tiny name; \
    static int open_##name(void **state __attribute__((unused))) \
    { \
        tiny_open(&name, n_frames); \
        return 0; \
    } \
    static int close_##name(void **state __attribute__((unused))) \
    { \
        tiny_close(&name); \
        return 0; \
    } \
    TEST_GROUP(open_##name, close_##name)

/* The capture that `s` makes, without its files. */
saga_capture tiny_capture(const saga_synth_options *s);

/* Options for a scene that moves, with these primitives and iterations. */
saga_train_options tiny_options(uint32_t n_primitives, int n_warm,
                                int n_render);
/* 150 of them, TINY_WARM and TINY_RENDER, lambda by the rule, 32 slots of
 * memory. */
saga_train_options tiny_defaults(void);
/* The same in three layers, without a memory. */
saga_train_options tiny_layered(void);

typedef struct trained {
    uint8_t *bytes;              /* free them */
    size_t n;
    saga_train_report report;
} trained;

saga_train *tiny_begin(const saga_capture *c, const saga_train_options *o);
saga_train *tiny_resume(const saga_capture *c, const saga_train_options *o);
/* Takes the training to its end, and it away. */
trained tiny_finish(saga_train *t);
trained tiny_train(const saga_capture *c, const saga_train_options *o);

/* The bytes, and what was said of the choice of sources. */
bool tiny_same(const trained *a, const trained *b);

/* A training stops once, where the stage has come to an iteration (-1: to any);
 * or every `every` calls. */
typedef struct tiny_stop {
    saga_train_stage stage;
    int iteration, every, calls;
} tiny_stop;

/* Makes the options stop there; `stop` as long as trainings have them. */
void tiny_stop_at(saga_train_options *o, tiny_stop *stop);
/* Trained to that place, where it can go on. */
saga_train *tiny_train_until(const saga_capture *c, saga_train_options *o,
                             tiny_stop *stop);

#endif
