/* SPDX-License-Identifier: MIT
 *
 * Chooses the tools of the picture (motion, rotation, fading, view-dependent
 * colour) that are worth more bytes than they cost in a scene.
 */
#ifndef SAGA_TOOL_CHOICE_H
#define SAGA_TOOL_CHOICE_H

#include "pictures.h"
#include "scene_model.h"
#include "splat.h"

/* Temporal tools are judged in this order, from the highest order of motion
 * on. */
enum {
    SAGA_TRAIN_MOTION_3,
    SAGA_TRAIN_MOTION_2,
    SAGA_TRAIN_MOTION_1,
    SAGA_TRAIN_SLOPE,
    SAGA_TRAIN_OPACITY_T,
    SAGA_TRAIN_VIEW,
    SAGA_TRAIN_N_TOOLS
};

extern const char *const saga_train_tool_names[SAGA_TRAIN_N_TOOLS];

/* The verdict on a tool, in bytes. Its worth is the growth of the squared error
 * on the warm-up's pictures without it, divided by the price of bits. The worth
 * of view-dependent colour is measured on views that had no part in finding
 * it. */
typedef struct saga_train_tool {
    double worth, cost; /* cost: bytes of its weights, and of the error
                         * that training without the tool would win
                         * back */
    bool asked, kept;
} saga_train_tool;

/* The choice is made at the end of the warm-up. */
typedef struct saga_tool_question {
    saga_model_terms terms; /* determine the sizes of the networks */
    double lambda;          /* > 0 */
    const saga_pictures *pictures;
    saga_splat_params flat; /* (n) primitives of the warm-up */
    uint32_t n;
    bool moves; /* the warm-up has temporal tools and keeps
                 * them */
} saga_tool_question;

typedef struct saga_tool_choice {
    uint32_t tools; /* SAGA_TOOL_* bits of the picture */
    saga_train_tool tool[SAGA_TRAIN_N_TOOLS]; /* the verdicts behind them */
} saga_tool_choice;

/* Returns the tools of the picture from which a training chooses, and with
 * whose temporal ones it warms up. The paper's model has all. Others have
 * motion of second order and no rotation in time, because four features more
 * take 8 to 14 % of a file, and at equal bytes the pictures are better without
 * (docs/lab/motion.md). */
uint32_t saga_plan_all_tools(const saga_train_options *o);

/* Chooses the tools. Returns false with *error set if memory is short. */
bool saga_plan_tools(saga_tool_choice *to, const saga_tool_question *q,
                     saga_error *error);

/* Changes n primitives, which move and fade, to what they are without the tools
 * that `tools` lacks. */
void saga_plan_reduce(saga_splat_params *p, uint32_t n, uint32_t tools);

#endif
