/* SPDX-License-Identifier: MIT
 *
 * Builds a scene from a flat set of primitives: the 4-D tree, its coarse
 * anchors, fine anchors and the primitives under them. Paper: Initialization
 * and Optimization; Hierarchical Morton Ordering.
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

/* The primitives from which a scene is built. */
typedef struct saga_hierarchy_pool {
    const saga_splat_params *p; /* (n) colour and log2_scale may be NULL; quat,
                                 * opacity and slope are only checked to be
                                 * finite */
    const float *score;         /* (n) >= 0, importance of each; NULL: all
                                 * equal */
    uint32_t n;                 /* >= 1 */
} saga_hierarchy_pool;

typedef struct saga_hierarchy_options {
    const saga_model *model; /* its tools, limits of children and suffix
                              * bits are used */
    uint32_t max_coarse;     /* most coarse anchors, >= 1 */
    uint32_t max_fine;       /* number of fine anchors, >= 1, as far as the
                              * limits of children allow it */
    unsigned long long seed; /* seed of the networks' first weights */
    /* The tree splits by phi = [x, lambda_t tau, lambda_h h], with x in
     * half-cubes, tau in segments, and h the colour, log2 scale / 8, velocity
     * in half-cubes per segment, and locality in time (see min_local). */
    double lambda_t, lambda_h;
    double min_time_std; /* in segments: a node is split in time only if
                          * its tau deviate at least by this */
    double min_local;    /* 0..1: and only if the mean locality of its
                          * primitives is at least this; that of
                          * temporal width s is 1 / (1 + 4 s^2) */
    double min_gain;     /* least reduction of the sum of squares per
                          * added leaf, as a part of the root's */
    /* A leaf wants fine anchors in proportion to W^alpha (H + epsilon)^beta,
     * where W is its part of the weights and H its variance of phi, over the
     * root's. */
    double alpha, beta, epsilon;
} saga_hierarchy_options;

#define saga_hierarchy_defaults SAGA_REAL_NAME(saga_hierarchy_defaults)
#define saga_hierarchy_build SAGA_REAL_NAME(saga_hierarchy_build)

/* Sets everything except the model and the budgets. */
void saga_hierarchy_defaults(saga_hierarchy_options *o);

/* Builds a scene, which the caller frees by saga_scene_free.
 * - Positions and times outside the cube and the segment are clamped to them.
 *   In a model without temporal tools every time is 1/2.
 * - The influence of a primitive's time on the tree falls with its temporal
 *   width. A primitive without a width (log2_width NULL, or a model without
 *   temporal opacity) is always visible, and its time has no influence.
 * - prim_origin (pool->n) is set to the index in the pool of the primitive at
 *   each rank.
 * The scene is what a decoder has before any residual, with these reals:
 * coarse_x is the weighted centre (and coarse.x, t the same in units), fine_x
 * the medoid, prim_x the primitive. Features are 0, and networks as
 * saga_scene_init makes them. Returns false with *error set, and no scene, if a
 * number is not finite (the primitive is named), the budgets are too small
 * (what is needed is named), a deepest cell has more primitives than a leaf can
 * have, or memory is short. */
bool saga_hierarchy_build(saga_scene *scene, uint32_t *prim_origin,
                          const saga_hierarchy_pool *pool,
                          const saga_hierarchy_options *o, saga_error *error);

#endif
