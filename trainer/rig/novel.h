/* SPDX-License-Identifier: MIT
 *
 * Makes pictures of views that no camera took. If cameras are far apart, a
 * model is wrong between them, and several models in different ways, so their
 * mean is less wrong than any of them. Models trained only for this purpose are
 * teachers. A model that learns their mean pictures from between the cameras,
 * besides the cameras' own, keeps most of the mean's advantage.
 *
 * Such a picture is a saga_sample too. Its view is an index of a camera here,
 * plus the n_views of the capture.
 */
#ifndef SAGA_NOVEL_H
#define SAGA_NOVEL_H

#include "pictures.h"

enum { SAGA_NOVEL_MOST_TEACHERS = 8 };

typedef struct saga_novel {
    saga_source_view *view; /* (n_views) cameras, without pictures */
    double *nearest;        /* (n_views) nearest depth, world units */
    int n_views;
    double part;    /* share of training pictures that are from these
                     * cameras */
    int n_teachers; /* so far */
    /* Copies of the teachers' primitives. */
    saga_splat_params teacher[SAGA_NOVEL_MOST_TEACHERS];
    uint32_t n[SAGA_NOVEL_MOST_TEACHERS]; /* number of primitives of each */
    saga_canvas canvas;                   /* draws a teacher's picture */
} saga_novel;

/* Places cameras by the training views (held-out views are not used): three
 * between a view and each of the two nearest views that look in a similar
 * direction. Those must be at most 40 degrees apart as seen from the middle of
 * the scene, and no view may be within 20. n_views is 0 if fewer than half of
 * the views have such neighbours. Returns false with *error set, and nothing to
 * free, if memory is short. */
bool saga_novel_init(saga_novel *novel, const saga_pictures *pictures,
                     saga_error *error);
void saga_novel_free(saga_novel *novel);

/* Copies n primitives as the next teacher. Returns false with *error set if
 * memory is short. */
bool saga_novel_teach(saga_novel *novel, const saga_splat_params *params,
                      uint32_t n, saga_error *error);

/* Saves the teachers, or reads them. When reading, the checkpoint is marked as
 * failed if one has more than most_primitives primitives or memory is short. */
void saga_novel_walk(saga_novel *novel, uint32_t most_primitives,
                     saga_checkpoint *checkpoint, saga_error *error);

/* Returns picture number `draw` of an endless sequence. With pictures->novel,
 * its part of them is from its cameras, at random; the others are those of
 * saga_pictures_pick, in their order. */
saga_sample saga_novel_pick(const saga_pictures *pictures, saga_rng rng,
                            uint64_t draw);

/* Tells whether a picture is from a camera of pictures->novel. */
static inline bool saga_novel_is(const saga_pictures *pictures,
                                 saga_sample sample)
{
    return sample.view >= pictures->capture->n_views;
}

/* Sets the canvas's camera, time and truth. The truth is what a view saw, or
 * the mean of what the teachers draw. Returns false with *error set if memory
 * is short. */
bool saga_novel_show(saga_canvas *canvas, const saga_pictures *pictures,
                     saga_sample sample, saga_error *error);

#endif
