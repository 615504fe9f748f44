/* SPDX-License-Identifier: MIT
 *
 * The model of a scene (sizes, number formats, steps and entropy sources)
 * follows from the options of the training and from its policy.
 */
#ifndef SAGA_SCENE_MODEL_H
#define SAGA_SCENE_MODEL_H

#include "ablation.h"
#include "model.h"
#include "options.h"
#include "policy.h"

/* The classes of coarse anchors in models with SAGA_TOOL_CLASSES. */
enum { SAGA_CLASS_STILL, SAGA_CLASS_MOVING };

typedef struct saga_model_terms {
    const saga_train_options *options; /* after saga_options_derive */
    const saga_ablation *ablation;
    const saga_policy *policy;
} saga_model_terms;

/* Fills *m. tools: the SAGA_TOOL_* bits for the picture and its splats. */
void saga_plan_model(saga_model *m, const saga_model_terms *terms,
                     uint32_t tools);

/* Returns the SAGA_TOOLS_SPLAT bits, which say how splats fall off, for a
 * training that makes the networks. */
uint32_t saga_plan_splats(const saga_train_options *o, const saga_ablation *a);

/* Returns the factor by which the networks' formats exceed the ranges of the
 * first segment, for segments that are still to come. */
double saga_plan_room(const saga_train_options *o);

/* Sets the members of *m that describe the entropy model: sources, groups and
 * network sizes. A memory bank has at most most_slots slots. */
void saga_plan_entropy_model(saga_model *m, const saga_ablation *a,
                             const saga_policy *p, uint32_t most_slots);

#endif
