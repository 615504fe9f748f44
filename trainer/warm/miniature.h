/* SPDX-License-Identifier: MIT
 *
 * A miniature of a capture has one moment of it, in small pictures, and only
 * the training views. A model of a miniature is trained in a fraction of a
 * second.
 */
#ifndef SAGA_MINIATURE_H
#define SAGA_MINIATURE_H

#include "capture.h"

typedef struct saga_miniature {
    saga_capture capture; /* n_frames is 1; no view is held out. Points are
                           * those of the original */
    int *view;            /* (n_views) the original's views */
    uint8_t *room;        /* memory of all pictures and masks */
} saga_miniature;

/* Returns the pixels of all pictures that a miniature of a capture would have,
 * and sets *n_views to their number. */
double saga_miniature_pixels(const saga_capture *capture, int *n_views);

/* Makes a miniature of the moment in the middle. The capture must outlive it.
 * The caller frees it, even if this fails. Returns false with *error set if
 * memory is short. */
bool saga_miniature_make(saga_miniature *miniature, const saga_capture *capture,
                         saga_error *error);
void saga_miniature_free(saga_miniature *miniature);

#endif
