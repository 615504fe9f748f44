/* SPDX-License-Identifier: MIT
 *
 * Trainings that take a tenth of a second, on the built-in room with a few
 * thousand pixels. Any failure fails the test.
 */
#ifndef TINY_TRAINING_H
#define TINY_TRAINING_H

#include "synth_capture.h"
#include "train.h"

enum { TINY_WARM = 40, TINY_RENDER = 60 };

/* A capture, and the path of its training's checkpoint, in a folder that
 * tiny_close removes. */
typedef struct tiny {
    char folder[64], checkpoint[80];
    saga_capture capture;
} tiny;

/* Makes the room with 64 x 36 pixels and four cameras, one of them held out. */
void tiny_open(tiny *t, int n_frames);
void tiny_close(tiny *t);

/* Declares a capture that all tests of the program share. */
#define TINY_GROUP(name, n_frames)                                \
    static tiny name;                                             \
    static int open_##name(void **state __attribute__((unused)))  \
    {                                                             \
        tiny_open(&name, n_frames);                               \
        return 0;                                                 \
    }                                                             \
    static int close_##name(void **state __attribute__((unused))) \
    {                                                             \
        tiny_close(&name);                                        \
        return 0;                                                 \
    }                                                             \
    TEST_GROUP(open_##name, close_##name)

/* Declares a capture of five frames, and the file that tiny_defaults() makes of
 * it. */
#define TRAINED_GROUP(name, file)                                 \
    static tiny name;                                             \
    static trained file;                                          \
    static int open_##name(void **state __attribute__((unused)))  \
    {                                                             \
        const saga_train_options o = tiny_defaults();             \
                                                                  \
        tiny_open(&name, 5);                                      \
        file = tiny_train(&name.capture, &o);                     \
        return 0;                                                 \
    }                                                             \
    static int close_##name(void **state __attribute__((unused))) \
    {                                                             \
        free(file.bytes);                                         \
        tiny_close(&name);                                        \
        return 0;                                                 \
    }                                                             \
    TEST_GROUP(open_##name, close_##name)

/* Returns the capture that `s` makes, and removes its files. */
saga_capture tiny_capture(const saga_synth_options *s);

/* Returns options for a moving scene with these numbers of primitives and
 * iterations. */
saga_train_options tiny_options(uint32_t n_primitives, int n_warm,
                                int n_render);
/* Returns options with 150 primitives, TINY_WARM and TINY_RENDER iterations,
 * lambda by the rule, and a bank of 32 slots. */
saga_train_options tiny_defaults(void);
/* Returns the same options with three layers and without a bank. */
saga_train_options tiny_layered(void);

typedef struct trained {
    uint8_t *bytes; /* the caller frees them */
    size_t n;
    saga_train_report report;
} trained;

saga_train *tiny_begin(const saga_capture *c, const saga_train_options *o);
saga_train *tiny_resume(const saga_capture *c, const saga_train_options *o);
/* Runs the training to its end, and frees it. */
trained tiny_finish(saga_train *t);
trained tiny_train(const saga_capture *c, const saga_train_options *o);

/* Begins the fit of a training in its rendering stage again. */
void tiny_begin_fit(saga_train *t);
/* Returns the PSNR, over all views and frames, of the pictures of the scene
 * with which the fit starts against those of the warm-up's primitives. */
double tiny_start_psnr(saga_train *t);

/* Draws a frame of a file as its first camera sees it. */
enum { TINY_PICTURE = 3 * 64 * 36 };
void tiny_draw(uint8_t rgb[TINY_PICTURE], const uint8_t *bytes, size_t n,
               uint32_t frame);

/* Returns whether bytes and reported choice of sources are equal. */
bool tiny_same(const trained *a, const trained *b);

/* Where a training stops: once, when the stage reaches an iteration (-1: any),
 * or whenever the progress function has been called `every` times. */
typedef struct tiny_stop {
    saga_train_stage stage;
    int iteration, every, calls;
} tiny_stop;

/* Sets options with which a training stops at `stop`, which must outlive it. */
void tiny_stop_at(saga_train_options *o, tiny_stop *stop);
/* Returns a training that has stopped at `stop` and can be continued. */
saga_train *tiny_train_until(const saga_capture *c, saga_train_options *o,
                             tiny_stop *stop);

#endif
