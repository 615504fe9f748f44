/* SPDX-License-Identifier: MIT
 *
 * A scene gets those tools of the picture that are worth more than they cost.
 */
#ifndef SAGA_TOOL_CHOICE_H
#define SAGA_TOOL_CHOICE_H

#include "pictures.h"
#include "scene_model.h"
#include "splat.h"

/* Temporal tools are asked from the last order of motion on. */
enum {
    SAGA_TRAIN_MOTION_3, SAGA_TRAIN_MOTION_2, SAGA_TRAIN_MOTION_1,
    SAGA_TRAIN_SLOPE, SAGA_TRAIN_OPACITY_T, SAGA_TRAIN_VIEW,
    SAGA_TRAIN_N_TOOLS
};

extern const char *const saga_train_tool_names[SAGA_TRAIN_N_TOOLS];

/* A tool of the picture is kept if it is worth more than it costs: bytes. Worth
 * is what the squared error of the warm-up's pictures grows by without it, at
 * the price of bits; of view-dependent colour what views lose that had no part
 * in finding it. */
typedef struct saga_train_tool {
    double worth, cost;          /* cost: of its weights, and what training
                                  * without it wins back */
    bool asked, kept;
} saga_train_tool;

/* The choice is made from the warm-up at its end. */
typedef struct saga_tool_question {
    saga_model_terms terms;      /* which networks' weights follow from */
    double lambda;               /* > 0 */
    const saga_pictures *pictures;
    saga_splat_params flat;      /* (n) the warm-up's primitives */
    uint32_t n;
    bool moves;                  /* it has temporal tools, and keeps them */
} saga_tool_question;

typedef struct saga_tool_choice {
    uint32_t tools;              /* of the picture, SAGA_TOOL_* */
    saga_train_tool tool[SAGA_TRAIN_N_TOOLS]; /* why */
} saga_tool_choice;

/* Chooses; fails where memory is short. */
bool saga_plan_tools(saga_tool_choice *to, const saga_tool_question *q,
                     saga_error *error);

/* Makes n primitives, which have all temporal attributes, what they are without
 * the tools that are not in `tools`. */
void saga_plan_reduce(saga_splat_params *p, uint32_t n, uint32_t tools);

#endif
