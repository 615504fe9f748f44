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
        score[i] = (float)(0.05 +
                           fmin(1, exp2(SAGA_PEAK_LOG2) /
                                       (1 + exp2(SAGA_PEAK_LOG2 -
                                                 (double)p->opacity[i]))));
    return score;
}

/* Returns the share of the segment in training of a number of anchors. */
static uint32_t of_segment(const saga_train *t, uint32_t anchors)
{
    return (uint32_t)((uint64_t)anchors * t->warm.options.n_primitives /
                      t->o.n_primitives);
}

static bool build(saga_train *t, uint32_t *source,
                  const saga_splat_params *kept, const saga_splat_params *pool,
                  uint32_t n, saga_error *error)
{
    float *const score = scores_of(pool, n, error);
    const saga_hierarchy_pool all = { pool, score, n };
    const saga_layers_terms layers = { saga_train_in_base(t)
                                           ? 1
                                           : (uint32_t)t->o.n_layers,
                                       &t->pictures, *kept, n };
    saga_hierarchy_options o;
    saga_model model;
    bool ok;

    /* If networks exist, their model holds for all segments. */
    if (t->packed.file.encoder)
        model = t->packed.file.networks.scene.model;
    else
        saga_train_model(&model, t);
    saga_hierarchy_defaults(&o);
    o.model = &model;
    o.max_coarse = of_segment(t, t->o.n_coarse);
    o.max_fine = of_segment(t, t->o.n_fine);
    o.seed = t->o.seed;
    ok = score &&
         saga_layers_build(&t->render.scene, source, &layers, &all, &o, error);
    free(score);
    return ok;
}

typedef struct {
    float score;
    uint32_t index;
} scored;

/* Orders by score, the highest first, and by index where scores are equal. */
static int compare(const void *a, const void *b)
{
    const scored *const x = a, *const y = b;

    if (x->score < y->score || x->score > y->score)
        return x->score > y->score ? -1 : 1;
    return x->index < y->index ? -1 : x->index > y->index;
}

static int compare_index(const void *a, const void *b)
{
    const uint32_t x = *(const uint32_t *)a, y = *(const uint32_t *)b;

    return x < y ? -1 : x > y;
}

/* Sets index[0..n) to the n primitives of the warm-up that are most opaque, in
 * their order. */
static bool keep_opaque(uint32_t *index, uint32_t n,
                        const saga_splat_params *flat, uint32_t n_flat,
                        saga_error *error)
{
    float *const score = scores_of(flat, n_flat, error);
    scored *const list = saga_alloc(n_flat, sizeof *list, "the targets", error);
    const bool ok = score && list;

    for (uint32_t i = 0; ok && i < n_flat; i++)
        list[i] = (scored){ score[i], i };
    if (ok)
        qsort(list, n_flat, sizeof *list, compare);
    for (uint32_t i = 0; ok && i < n; i++)
        index[i] = list[i].index;
    if (ok)
        qsort(index, n, sizeof *index, compare_index);
    free(list);
    free(score);
    return ok;
}

/* Sets *kept to the primitives that the fit begins with: those of the warm-up,
 * or if the level has no room for all, copies of as many as it has. The chosen
 * tools decide how many these are, so that it is not known before. */
static bool keep(saga_splat_params *kept, uint32_t *n, saga_train *t,
                 saga_error *error)
{
    const saga_splat_params flat = saga_flat_params(t->warm.flat);
    const uint32_t all = saga_flat_count(t->warm.flat);
    /* The base of the segments has its place already. */
    const uint32_t base = t->backdrop.n;
    uint32_t *index;
    bool ok;

    *kept = flat;
    *n = saga_train_room(t, all + base) - base;
    if (*n == all)
        return true;
    if (t->o.given)
        return saga_fail(error, NULL, "take a higher --level",
                         "%u splats "
                         "need more of a decoder's memory or work than level "
                         "%d has; it has room for %u",
                         all, t->o.level, *n);
    if (t->report.n_left_out < all - *n)
        t->report.n_left_out = all - *n;
    index = saga_alloc(*n, sizeof *index, "the targets", error);
    ok = index && keep_opaque(index, *n, &flat, all, error) &&
         saga_params_gather(kept, &flat, index, *n, error);
    free(index);
    return ok;
}

/* Makes the hierarchy, and its targets in order of ranks, from the warm-up's
 * primitives. */
static bool propose(saga_train *t, saga_error *error)
{
    saga_splat_params kept, pool;
    uint32_t n, *source;
    bool ok;

    if (!keep(&kept, &n, t, error))
        return false;
    source = saga_alloc(n, sizeof *source, "the targets", error);
    ok = saga_params_gather(&pool, &kept, NULL, n, error) && source;
    /* Attributes without a tool are removed first, so that the tree does not
     * depend on them. */
    if (ok && t->render.dynamic && t->warm.options.temporal) {
        saga_plan_reduce(&pool, n, t->render.tools);
        saga_targets_centre(&pool, n);
    } else if (ok)
        saga_targets_freeze(&pool, n);
    ok = ok && build(t, source, &kept, &pool, n, error);
    /* A base has no temporal attributes, even if the model of the file has. */
    t->render.scene.still = saga_train_in_base(t);
    ok = ok && saga_params_gather(&t->render.target, &pool, source,
                                  t->render.scene.n.prim, error);
    saga_params_free(&pool);
    if (n < saga_flat_count(t->warm.flat))
        saga_params_free(&kept);
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

    if (!(t->policy.lambda > 0))
        t->policy.lambda = saga_policy_lambda(t->recent_mse, n_pixels,
                                              t->o.n_primitives);
    t->policy = saga_policy_of(t->policy.lambda, n_pixels, t->o.n_primitives);
}

bool saga_train_begin_fit(saga_train *t, saga_error *error)
{
    saga_fit_options o = { .n_render = t->o.n_render,
                           .seed = t->o.seed,
                           .gpu = t->o.gpu,
                           .raw_networks = t->ablation.raw_networks,
                           .keep_sources = t->o.paper,
                           .given = t->packed.file.encoder
                                        ? &t->packed.file.networks
                                        : NULL };

    /* A training restored from a checkpoint already has lambda, but not the
     * prices that follow from it. */
    saga_train_settle_price(t);
    o.price = t->policy.price;
    t->render.fitting = true;
    saga_train_end_teaching(t);
    if (!propose(t, error))
        return false;
    t->render.fit = saga_fit_new(&t->render.scene, &t->pictures, &o, error);
    return t->render.fit != NULL;
}
