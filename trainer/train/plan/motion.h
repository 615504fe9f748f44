/* SPDX-License-Identifier: MIT
 *
 * Decides whether the scene moves, since temporal tools are wasted on a still
 * scene. A capture of one frame has none. One of several frames loses them if
 * the warm-up shows that nothing moves.
 *
 * The rule looks at the pixels of training views that differ by more than 8/255
 * from the middle frame of their view. Temporal tools stay on if these pixels
 * are at least 10^-4 of all and the warm-up explains at least a tenth of their
 * change against the middle frame, that is 1 - sum (change - drawn
 * change)^2 / sum change^2 >= 0.1. Camera noise makes such pixels too, but a
 * fitted model cannot predict noise: it explains a few hundredths of it at
 * most.
 */
#ifndef SAGA_MOTION_H
#define SAGA_MOTION_H

#include "flat.h"
#include "options.h"
#include "pictures.h"

typedef struct saga_motion_found {
    bool moves;       /* the temporal tools are on */
    double explained; /* part of the change, by the rule above; NaN:
                       * it was not measured */
    double changing;  /* part of the pixels that differ */
} saga_motion_found;

/* Returns how much of a capture moves: the part of the pixels of training views
 * that differ by more than 8/255 from the middle frame of their view. The
 * segment in which it is largest is trained first, since its networks learn
 * most of what the others need. */
double saga_plan_change(const saga_capture *capture);

/* Decides whether anything moves, at the end of a warm-up. On entry
 * found->moves tells whether the warm-up had temporal tools, on return whether
 * the scene keeps them. Returns false with *error set if a picture cannot be
 * drawn. */
bool saga_plan_motion(saga_motion_found *found, saga_flat *flat,
                      const saga_pictures *pictures, saga_train_motion motion,
                      saga_error *error);

#endif
