/* SPDX-License-Identifier: MIT
 *
 * Model only what a scene needs. A capture of one frame has no temporal tools.
 * One of several loses them when the warm-up shows that nothing moves. Looked
 * at are the pixels of training views that differ by more than 8/255 from the
 * view's middle frame. Where they are at least 10^-4 of all, and the warm-up's
 * own change against its middle frame explains at least a tenth of theirs
 * (1 - sum (change - drawn change)^2 / sum change^2), temporal tools are on.
 * Camera noise makes such pixels too, but nothing that is fitted foretells
 * noise: it explains some hundredths of it at most.
 */
#ifndef SAGA_MOTION_H
#define SAGA_MOTION_H

#include "flat.h"
#include "options.h"
#include "pictures.h"

typedef struct saga_motion_found {
    bool moves;                  /* temporal tools are on */
    double explained;            /* by the rule above; NaN: not measured */
    double changing;             /* part of the pixels the rule looked at */
} saga_motion_found;

/* Returns how much of a capture moves: of the pixels of training views, the
 * part that differs by more than 8/255 from the view's middle frame. The more
 * a segment moves, the more its networks learn that others need. */
double saga_plan_change(const saga_capture *capture);

/* Decides whether anything moves, by a warm-up at its end: found->moves says
 * whether it had temporal tools, and becomes whether the scene has. */
bool saga_plan_motion(saga_motion_found *found, saga_flat *flat,
                      const saga_pictures *pictures, saga_train_motion motion,
                      saga_error *error);

#endif
