/* SPDX-License-Identifier: MIT */
#include "fit_room.h"

#include "alloc.h"
#include "away_rate.h"
#include "fit_away.h"
#include "fit_state.h"
#include "gpu_iterate.h"

#include <stdlib.h>

/* Returns a scene that has no memory, but its networks' shapes. */
static saga_scene shape_of(const saga_model *model, saga_counts n)
{
    saga_scene s = { .model = *model, .n = n };

    for (int i = 0; i < SAGA_N_NETS; i++)
        saga_scene_shape(&s.net[i], model, i);
    return s;
}

/* An anchor has at most as many links in a set as a model has neighbours. */
static uint32_t most_links(const saga_scene *s)
{
    const uint32_t coarse = s->model.tier[SAGA_TIER_COARSE].neighbours;
    const uint32_t fine = s->model.tier[SAGA_TIER_FINE].neighbours;

    return s->n.coarse * (coarse > fine ? coarse : fine);
}

static bool iteration_room(saga_gpu_canvas *g, const saga_canvas *canvas,
                           saga_scene *s, saga_rate *all, saga_error *error)
{
    const saga_gpu_turn turn = { .n = s->n.prim,
                                 .features = s->model.features,
                                 .fine = &s->net[SAGA_NET_FINE],
                                 .d_fine = &s->net[SAGA_NET_FINE],
                                 .base = saga_away_n_params(s) };
    const saga_away away = { .scene = s, .d = s };
    const saga_rate_options o = { .every = 1 };
    saga_away_prims prims;
    saga_away_rates rates;

    saga_away_list_prims(&prims, &away, s->n.prim);
    saga_away_list_rates(&rates, all, s, s, &o);
    return saga_gpu_anchors_room(g, s->n.prim, s->model.features, error) &&
           saga_gpu_put_rates_room(g, s->n.coarse, most_links(s), error) &&
           saga_gpu_iteration_room(
               g, &(saga_gpu_iteration){ &turn, &prims.to, &rates.to }, canvas,
               error);
}

/* Makes what an iteration with all sources has that stays on the device
 * (fit_stay.c). If the model shares anchors or the device cannot do it, none
 * does. */
static bool stay_room(saga_gpu *gpu, saga_gpu_canvas *g,
                      const saga_canvas *canvas, saga_scene *s,
                      saga_error *error)
{
    const saga_away away = { .scene = s, .d = s };
    saga_rate *all;
    bool ok;

    if (s->n.coarse < s->n.prim || s->n.fine < s->n.prim)
        return true;
    all = saga_calloc(1, sizeof *all, "the fit", error);
    if (!all)
        return false;
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        all->context.keep[kind] = SAGA_SOURCES_KNOWN;
    ok = !saga_away_can(gpu, &away) || !saga_away_can_rate(gpu, all, s) ||
         iteration_room(g, canvas, s, all, error);
    free(all);
    return ok;
}

bool saga_fit_room(saga_gpu *gpu, const saga_pictures *pictures,
                   const saga_canvas *canvas, const saga_model *model,
                   saga_counts n, int n_teachers, saga_error *error)
{
    const saga_block_adam features = { .n = n.coarse,
                                       .width = saga_fit_width(model),
                                       .stride = model->features };
    const bool has = saga_gpu_has_blocks(gpu, features.n, features.width);
    saga_scene s = shape_of(model, n);
    saga_gpu_canvas *const g = saga_gpu_canvas_new(gpu, pictures, error);
    saga_gpu_blocks *const blocks = has ? saga_gpu_blocks_new(gpu, error)
                                        : NULL;
    /* The canvas comes first and the features' state last, so that its way
     * comes on top of all. */
    const bool ok =
        g && saga_gpu_pictures_room(g, error) &&
        saga_gpu_learn_room(g, canvas, saga_attrs_of_tools(model->tools, false),
                            n.prim, error) &&
        saga_gpu_teachers_room(g, canvas, saga_attrs_of_tools(0, true), n.prim,
                               n_teachers, error) &&
        (!has || (blocks && stay_room(gpu, g, canvas, &s, error) &&
                  saga_gpu_blocks_plan(blocks, &features, error)));

    saga_gpu_blocks_free(blocks);
    saga_gpu_canvas_free(g);
    return ok;
}
