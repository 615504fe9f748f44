/* SPDX-License-Identifier: MIT */
#include "fit_stay.h"

#include "gpu_iterate.h"
#include "suffix.h"

/* Tells whether a model's neighbours may change, or offsets have constants. One
 * neighbour is the parent, and anchors do not move. */
static bool has_to_look(const saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const saga_rate_context *const c = &f->rate.context;

    return s->model.tier[SAGA_TIER_COARSE].neighbours > 1 ||
           s->model.tier[SAGA_TIER_FINE].neighbours > 1 ||
           !saga_rate_sources(c, s, SAGA_KIND_PRIM);
}

bool saga_fit_can_stay(const saga_fit *f)
{
    saga_scene d = f->grad;
    const saga_away away = { .scene = f->scene, .d = &d };
    const bool looks = f->iteration == 0 ||
                       (f->iteration % SAGA_FIT_REFRESH_EVERY == 0 &&
                        has_to_look(f));
    const bool chooses = saga_fit_is_rounding(f) && !f->o.given &&
                         !f->rate.decision.decided;

    return f->gpu && f->descent.away && f->has_own && f->twin.whole &&
           !chooses && !looks && !saga_fit_rounds_layers(f) &&
           saga_away_can(f->o.gpu, &away) &&
           saga_away_can_rate(f->o.gpu, &f->rate, f->scene);
}

/* --- What stays ---------------------------------------------------------- */

static saga_gpu_anchors anchors_of(saga_fit *f)
{
    saga_scene *const s = f->scene;
    const size_t at = (size_t)(s->prim_x - s->reals);

    return (saga_gpu_anchors){ .n = s->n.prim,
                               .features = s->model.features,
                               .fine_x = s->fine_x,
                               .fine_offset = f->twin.fine_offset,
                               .level = f->level,
                               .limit = f->limit,
                               .prim_x = s->prim_x,
                               .m = f->descent.m + at,
                               .v = f->descent.v + at,
                               .support = f->twin.support,
                               .offset = f->twin.prim_offset,
                               .mu_feature = f->rate.mu_feature,
                               .mu_offset = f->rate.mu_offset };
}

/* Copies to the device what it does not have. */
static bool go_there(saga_fit *f, const saga_block_adam *features,
                     saga_error *error)
{
    const saga_gpu_anchors a = anchors_of(f);
    saga_descent *const d = &f->descent;

    d->is_away = d->is_away || saga_gpu_blocks_put(d->away, features, error);
    f->is_rated_away = d->is_away &&
                       (f->is_rated_away ||
                        saga_away_put_rate(f->gpu, &f->rate, f->scene, error));
    f->is_there = f->is_rated_away &&
                  (f->is_there || saga_gpu_anchors_put(f->gpu, &a, error));
    return f->is_there;
}

bool saga_fit_look(saga_fit *f, saga_error *error)
{
    const saga_block_adam features = saga_fit_features(f);
    const saga_gpu_anchors a = anchors_of(f);

    f->is_newer_there = f->is_newer_there &&
                        !(saga_gpu_blocks_look(f->descent.away, &features,
                                               error) &&
                          saga_gpu_anchors_get(f->gpu, &a, error));
    return !f->is_newer_there;
}

bool saga_fit_bring(saga_fit *f, saga_error *error)
{
    saga_descent *const d = &f->descent;
    const saga_block_adam features = saga_fit_features(f);

    /* After a failure the host's older state must not pass for the new one. */
    d->is_newer = d->is_newer &&
                  !saga_gpu_blocks_get(d->away, &features, error);
    return !d->is_newer && saga_fit_look(f, error);
}

/* --- An iteration -------------------------------------------------------- */

/* Tells whether features have constants. These are measured in every iteration,
 * as on the host: features are rounded around them, and coded around those of
 * the end. Constants of 50 iterations before cost 0.3 dB. */
static bool has_constants(const saga_fit *f)
{
    return !f->rate.decision.given &&
           !saga_rate_sources(&f->rate.context, f->scene, SAGA_KIND_COARSE);
}

static saga_gpu_turn turn_of(saga_fit *f, const saga_block_adam *features,
                             const saga_adam *adam)
{
    const saga_scene *const s = &f->used;

    return (saga_gpu_turn){
        .n = s->n.prim,
        .features = s->model.features,
        .rounding = saga_fit_is_rounding(f),
        .feature_key = saga_fit_noise(f, SAGA_STREAM_NOISE).key,
        .offset_key = saga_fit_noise(f, SAGA_STREAM_OFFSET).key,
        .feature_step = R(saga_fit_feature_step(s)),
        .prim_step = R(saga_rate_prim_step(s)),
        .suffix_bits = s->model.tier[SAGA_TIER_FINE].suffix_bits,
        .most_offset = R(SAGA_OFFSET_MAX),
        .least_x = saga_twin_least_support(0),
        .least_t = saga_twin_least_support(3),
        .price = SAGA_FIT_ANCHOR_PRICE / R(4 * s->n.prim),
        .fine = &s->net[SAGA_NET_FINE],
        .d_fine = &f->grad.net[SAGA_NET_FINE],
        .base = saga_away_n_params(s),
        .adam = adam,
        .step = (uint64_t)f->iteration + 1,
        .prim_rate = saga_fit_rates_now(f).prim,
        .blocks = features,
        .looks = has_constants(f)
    };
}

bool saga_fit_stay(saga_fit *f, double *mse, saga_sample picture,
                   uint32_t n_drawn, saga_error *error)
{
    const saga_adam adam = saga_adam_default();
    const saga_block_adam features = saga_fit_features(f);
    const saga_gpu_turn turn = turn_of(f, &features, &adam);
    const saga_away away = { .scene = &f->used,
                             .d = &f->grad,
                             .size_price = saga_fit_size_price(f) };
    const saga_rate_options o = saga_fit_rate_options(f);
    const saga_rate_input x = { f->scene, &f->twin, NULL };
    saga_away_prims prims;
    saga_away_rates rates;

    if (!go_there(f, &features, error) ||
        !saga_gpu_show(f->gpu, &f->canvas, picture, error))
        return false;
    /* The host has the features of the iteration before. */
    if (turn.looks)
        saga_rate_measure(&f->rate, &x, SAGA_KIND_COARSE);
    saga_away_list_prims(&prims, &away, n_drawn);
    saga_away_list_rates(&rates, &f->rate, &f->grad, f->scene, &o);
    f->is_newer_there = f->descent.is_newer = true;
    if (!saga_gpu_iterate(f->gpu, f->descent.away, mse,
                          &(saga_gpu_iteration){ &turn, &prims.to, &rates.to },
                          &f->canvas, error))
        return false;
    saga_away_bits(f->bits, &rates);
    return true;
}
