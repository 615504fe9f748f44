/* SPDX-License-Identifier: MIT
 *
 * Leads from the warm-up to the fit: turns the warm-up's primitives into a
 * hierarchy and targets in the order of its ranks, and sets the price of a bit.
 */
#include "train_state.h"

#include "alloc.h"
#include "hierarchy.h"
#include "layers.h"
#include "targets.h"

#include <math.h>
#include <stdlib.h>

/* Returns the score (n) of each primitive for the choice of anchors; opaque
 * primitives have the highest. */
static float *scores_of(const saga_splat_params *p, uint32_t n,
                        saga_error *error)
{
    float *const score = saga_alloc(n, sizeof *score, "the warm-up's scores",
                                    error);

    /* Peak alpha is 8 / (1 + 2^(3 - o)), and pixels show at most 1 of it. The
     * 0.05 counts even primitives that have nearly vanished. */
    for (uint32_t i = 0; score && i < n; i++)
        score[i] = (float)(0.05 + fmin(1, exp2(SAGA_PEAK_LOG2) /
                           (1 + exp2(SAGA_PEAK_LOG2 -
                                     (double)p->opacity[i]))));
    return score;
}

/* Returns the share of the segment in training of a number of anchors. */
static uint32_t of_segment(const saga_train *t, uint32_t anchors)
{
    return (uint32_t)((uint64_t)anchors * t->flat_options.n_primitives /
                      t->o.n_primitives);
}

static bool build(saga_train *t, uint32_t *source,
                  const saga_splat_params *pool, uint32_t n,
                  saga_error *error)
{
    float *const score = scores_of(pool, n, error);
    const saga_hierarchy_pool all = { pool, score, n };
    const saga_layers_terms layers = {
        saga_train_in_base(t) ? 1 : (uint32_t)t->o.n_layers, &t->pictures,
        saga_flat_params(t->flat), n
    };
    saga_hierarchy_options o;
    saga_model model;
    bool ok;

    /* If networks exist, their model holds for all segments. */
    if (t->file.encoder)
        model = t->file.networks.scene.model;
    else
        saga_train_model(&model, t);
    saga_hierarchy_defaults(&o);
    o.model = &model;
    o.max_coarse = of_segment(t, t->o.n_coarse);
    o.max_fine = of_segment(t, t->o.n_fine);
    o.seed = t->o.seed;
    ok = score && saga_layers_build(&t->scene, source, &layers, &all, &o,
                                    error);
    free(score);
    return ok;
}

/* Makes the hierarchy, and its targets in order of ranks, from the warm-up's
 * primitives. */
static bool propose(saga_train *t, saga_error *error)
{
    const saga_splat_params flat = saga_flat_params(t->flat);
    const uint32_t n = saga_flat_count(t->flat);
    uint32_t *const source = saga_alloc(n, sizeof *source, "the targets",
                                        error);
    saga_splat_params pool;
    bool ok = saga_params_gather(&pool, &flat, NULL, n, error) && source;

    /* Attributes without a tool are removed first, so that the tree does not
     * depend on them. */
    if (ok && t->dynamic && t->flat_options.temporal) {
        saga_plan_reduce(&pool, n, t->tools);
        saga_targets_centre(&pool, n);
    } else if (ok)
        saga_targets_freeze(&pool, n);
    ok = ok && build(t, source, &pool, n, error);
    /* A base has no temporal attributes, even if the model of the file has. */
    t->scene.still = saga_train_in_base(t);
    ok = ok &&
         saga_params_gather(&t->target, &pool, source, t->scene.n.prim, error);
    saga_params_free(&pool);
    free(source);
    return ok;
}

/* Returns the number of training pixels against which bits are weighed. For the
 * base they are those of all segments, since it appears in each. */
static double n_pixels_of(saga_train *t)
{
    /* The number is kept from the first segment, because the base itself is
     * trained on only one picture of each view. */
    if (t->turn == 0)
        t->n_pixels = saga_pictures_pixels(&t->pictures);
    return saga_train_in_base(t) ? t->n_pixels * t->o.n_segments
                                 : saga_pictures_pixels(&t->pictures);
}

void saga_train_settle_price(saga_train *t)
{
    const double n_pixels = n_pixels_of(t);

    if (!(t->lambda > 0))
        t->lambda = saga_policy_lambda(t->recent_mse, n_pixels,
                                       t->o.n_primitives);
    t->policy = saga_policy_of(t->lambda, n_pixels, t->o.n_primitives);
}

bool saga_train_begin_fit(saga_train *t, saga_error *error)
{
    saga_fit_options o = {
        .n_render = t->o.n_render, .seed = t->o.seed,
        .raw_networks = t->ablation.raw_networks,
        .keep_sources = t->o.paper,
        .given = t->file.encoder ? &t->file.networks : NULL
    };

    /* A training restored from a checkpoint already has lambda, but not the
     * prices that follow from it. */
    saga_train_settle_price(t);
    o.price = t->policy.price;
    t->fitting = true;
    saga_train_end_teaching(t);
    if (!propose(t, error))
        return false;
    t->fit = saga_fit_new(&t->scene, &t->pictures, &o, error);
    return t->fit != NULL;
}
