/* SPDX-License-Identifier: MIT
 *
 * Decides whether a file has a base, and how many primitives the base has. The
 * warm-up of the first segment to be trained shows how much stands still.
 */
#ifndef SAGA_BASE_CHOICE_H
#define SAGA_BASE_CHOICE_H

#include "options.h"
#include "splat.h"

/* The reasons for which a file has no base. */
typedef enum saga_train_no_base {
    SAGA_TRAIN_HAS_BASE, /* no reason: it has one */
    SAGA_TRAIN_ONE_SEGMENT,
    SAGA_TRAIN_ABLATED,
    SAGA_TRAIN_WANDERS, /* the camera moves: no two pictures are from
                         * one place */
    SAGA_TRAIN_MOVES,   /* too little stands still for this number of
                         * segments */
    SAGA_TRAIN_SUBJECT  /* the capture is of a subject, whose masks are
                         * opacities (still.h needs those of what stands
                         * still) */
} saga_train_no_base;

typedef struct saga_train_base {
    saga_train_no_base why;
    uint32_t n_still;     /* primitives of the first warm-up that stand
                           * still */
    uint32_t n_looked_at; /* primitives that were tested for it; 0:
                           * none */
    uint32_t n_prim;      /* primitives of the base; 0: there is none */
    uint32_t n_kept;      /* primitives of each segment besides the
                           * base */
    double saved;         /* estimate of the bytes that the base saves;
                           * not meaningful if a size was asked for */
} saga_train_base;

typedef struct saga_base_question {
    const saga_train_options *options;
    const saga_ablation *ablation;
    bool wanders;           /* the capture is from one moving camera */
    bool subject;           /* the capture is of a subject */
    bool moves;             /* anything in the scene moves */
    uint32_t room;          /* primitives that the level has room for, of
                             * base and segment together */
    saga_splat_params flat; /* (n) the warm-up's primitives at its end */
    uint32_t n;
} saga_base_question;

/* Returns a reason against a base that can be told without the warm-up's
 * primitives; SAGA_TRAIN_HAS_BASE if there is none. */
saga_train_no_base saga_plan_no_base(const saga_base_question *q);

void saga_plan_base(saga_train_base *b, const saga_base_question *q);

/* Tells whether primitive i is visible throughout the segment, as the base and
 * the choice of a base need it. p has the temporal members. */
bool saga_plan_is_long(const saga_splat_params *p, size_t i);

#endif
