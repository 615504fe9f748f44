/* SPDX-License-Identifier: MIT
 *
 * A flat set of primitives becomes a scene: the 4-D tree, its coarse anchors,
 * fine anchors and the primitives under them. Paper: Initialization and
 * Optimization; Hierarchical Morton Ordering.
 *
 * The same input gives the same scene: every order below is total (ties go to
 * the smaller index or rank), and nothing is random.
 */
#ifndef SAGA_HIERARCHY_H
#define SAGA_HIERARCHY_H

#include "error.h"
#include "scene.h"
#include "splat.h"

#include <stdint.h>

/* A scene is built from these primitives. */
typedef struct saga_hierarchy_pool {
    const saga_splat_params *p;  /* (n) colour and log2_scale may be NULL; quat,
                                  * opacity and slope are looked at for numbers
                                  * that are not finite alone */
    const float *score;          /* (n) >= 0: the importance of each; NULL: all
                                  * alike */
    uint32_t n;                  /* >= 1 */
} saga_hierarchy_pool;

typedef struct saga_hierarchy_options {
    const saga_model *model;     /* tools, limits of children, suffix bits */
    uint32_t max_coarse;         /* budgets, >= 1; the fine one is used up as */
    uint32_t max_fine;           /* far as the limits of children let it */
    unsigned long long seed;     /* of the networks */
    /* The tree splits phi = [x, lambda_t tau, lambda_h h]; x in half-cubes, tau
     * in segments, h: colour, log2 scale / 8, velocity in half-cubes per
     * segment, locality in time (see min_local). */
    double lambda_t, lambda_h;
    double min_time_std;         /* segments: a node whose tau deviate less is
                                  * not split in time, */
    double min_local;            /* nor one whose primitives are local in time
                                  * less than this on average: 0..1; one of
                                  * temporal width s is 1 / (1 + 4 s^2) */
    double min_gain;             /* least reduction per added leaf, as a share
                                  * of the root's sum of squares */
    /* A leaf wants fine anchors as A = W^alpha (H + epsilon)^beta, with W its
     * share of the weights, H its variance of phi over the root's. */
    double alpha, beta, epsilon;
} saga_hierarchy_options;

#define saga_hierarchy_defaults SAGA_REAL_NAME(saga_hierarchy_defaults)
#define saga_hierarchy_build SAGA_REAL_NAME(saga_hierarchy_build)

/* Sets everything but the model and the budgets. */
void saga_hierarchy_defaults(saga_hierarchy_options *o);

/* Builds scene (saga_scene_free it).
 * - Positions and times beyond the cube and the segment are clamped to it; in
 *   a model without temporal tools every time is 1/2.
 * - A primitive's say in the tree's time shrinks with its temporal width; one
 *   without (log2_width NULL, or a model without temporal opacity) is seen all
 *   the time and has none.
 * - prim_origin (pool->n): the primitive of the pool that became the scene's of
 *   each rank.
 * The scene is what a decoder has before any residual, with these reals:
 * coarse_x the weighted centre (and coarse.x, t the same in units), fine_x the
 * medoid, prim_x the primitive; features are 0, networks as saga_scene_init
 * leaves them.
 * False: a number is not finite (the primitive is named), the budgets are too
 * small (with what is needed), more primitives are in a deepest cell than one
 * leaf can take, or there is no memory. Then there is no scene. */
bool saga_hierarchy_build(saga_scene *scene, uint32_t *prim_origin,
                          const saga_hierarchy_pool *pool,
                          const saga_hierarchy_options *o, saga_error *error);

#endif
