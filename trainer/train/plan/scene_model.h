/* SPDX-License-Identifier: MIT
 *
 * The model of a scene, in sizes, formats, steps and sources, follows from what
 * was asked for and from what its price decides.
 */
#ifndef SAGA_SCENE_MODEL_H
#define SAGA_SCENE_MODEL_H

#include "ablation.h"
#include "model.h"
#include "options.h"
#include "policy.h"

typedef struct saga_model_terms {
    const saga_train_options *options; /* derived */
    const saga_ablation *ablation;
    const saga_policy *policy;
} saga_model_terms;

/* Makes m, with these tools of the picture and of its splats, SAGA_TOOL_*. */
void saga_plan_model(saga_model *m, const saga_model_terms *terms,
                     uint32_t tools);

/* Sets what of the model its entropy model is: sources, groups, sizes. A memory
 * bank has at most most_slots. */
void saga_plan_entropy_model(saga_model *m, const saga_ablation *a,
                             const saga_policy *p, uint32_t most_slots);

#endif
