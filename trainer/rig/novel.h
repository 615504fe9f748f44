/* SPDX-License-Identifier: MIT
 *
 * Pictures that nobody took. Where cameras stand far apart, a model is wrong
 * between them, each of several in another way, and their mean is less wrong
 * than any. Models that are only for this are teachers; one that is shown
 * pictures of their mean from between the cameras, beside what the cameras
 * saw, keeps most of what the mean is better by.
 *
 * A picture of theirs is a saga_sample, too: its view is one of the cameras
 * here, counted from the capture's n_views on.
 */
#ifndef SAGA_NOVEL_H
#define SAGA_NOVEL_H

#include "pictures.h"

enum { SAGA_NOVEL_MOST_TEACHERS = 8 };

typedef struct saga_novel {
    saga_shot *shot;      /* (n_shots) cameras, without pictures */
    double *nearest;      /* (n_shots) nearest depth, world */
    int n_shots;
    int n_teachers;       /* that there are by now */
    saga_splat_params teacher[SAGA_NOVEL_MOST_TEACHERS]; /* own arrays */
    uint32_t n[SAGA_NOVEL_MOST_TEACHERS]; /* their primitives */
    saga_canvas canvas;   /* what one of them draws */
} saga_novel;

/* Places cameras by the training views alone, held-out ones are not looked at:
 * three between a view and each of the two that are nearest to it and look the
 * same way, up to 40 degrees off as seen from the middle of the scene, where
 * none is within 10. n_shots is 0 where no view has such neighbours. Fails
 * where memory is short; it leaves nothing to be freed then. */
bool saga_novel_init(saga_novel *novel, const saga_pictures *pictures,
                     saga_error *error);
void saga_novel_free(saga_novel *novel);

/* Copies n primitives as one more teacher. Fails where memory is short. */
bool saga_novel_teach(saga_novel *novel, const saga_splat_params *params,
                      uint32_t n, saga_error *error);

/* Saves the teachers; or reads them, who have at most most_primitives each.
 * Reading fails as checkpoints do, or for want of memory. */
void saga_novel_walk(saga_novel *novel, uint32_t most_primitives,
                     saga_checkpoint *checkpoint, saga_error *error);

/* Returns number `draw` of an endless row: where pictures->novel is there,
 * three in ten are from it, of any of its cameras at any frame; the others are
 * those of saga_pictures_pick, in their order. */
saga_sample saga_novel_pick(const saga_pictures *pictures, saga_rng rng,
                            uint64_t draw);

/* Tells whether a picture is one that nobody took. */
static inline bool saga_novel_is(const saga_pictures *pictures,
                                 saga_sample sample)
{
    return sample.view >= pictures->capture->n_views;
}

/* Sets the canvas's camera, time and truth: what a view saw, or what the
 * teachers draw on the mean. Fails where memory is short. */
bool saga_novel_show(saga_canvas *canvas, const saga_pictures *pictures,
                     saga_sample sample, saga_error *error);

#endif
