/* SPDX-License-Identifier: MIT
 *
 * Is there a base, and how many primitives has it? The warm-up of the segment
 * that is trained first shows how much stands still.
 */
#ifndef SAGA_BASE_CHOICE_H
#define SAGA_BASE_CHOICE_H

#include "options.h"
#include "splat.h"

/* There is no base for one of these reasons. */
typedef enum saga_train_no_base {
    SAGA_TRAIN_HAS_BASE,         /* there is one */
    SAGA_TRAIN_ONE_SEGMENT,
    SAGA_TRAIN_ABLATED,
    SAGA_TRAIN_WANDERS,          /* no two pictures are from one place */
    SAGA_TRAIN_MOVES             /* too little stands still, or for too
                                  * few segments */
} saga_train_no_base;

typedef struct saga_train_base {
    saga_train_no_base why;
    uint32_t n_still;            /* primitives of the first warm-up that stand
                                  * still, */
    uint32_t n_looked_at;        /* number of those looked at; 0: none were */
    uint32_t n_prim;             /* of the base; 0: there is none */
    uint32_t n_kept;             /* of each segment beside it */
    double saved;                /* bytes that this saves, an estimate; of no
                                  * meaning where a size was asked for */
} saga_train_base;

typedef struct saga_base_question {
    const saga_train_options *options;
    const saga_ablation *ablation;
    bool wanders;                /* the capture's camera */
    bool moves;                  /* anything does */
    saga_splat_params flat;      /* (n) the warm-up's primitives at its end */
    uint32_t n;
} saga_base_question;

/* Returns why there is none, without a look at the warm-up's primitives;
 * SAGA_TRAIN_HAS_BASE: there may be one. */
saga_train_no_base saga_plan_no_base(const saga_base_question *q);

void saga_plan_base(saga_train_base *b, const saga_base_question *q);

/* Tells whether primitive i lives through the segment; p has temporal members.
 */
bool saga_plan_is_long(const saga_splat_params *p, size_t i);

#endif
