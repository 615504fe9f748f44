/* SPDX-License-Identifier: MIT */
#include "fit_room.h"

#include "away_rate.h"
#include "fit_away.h"
#include "fit_state.h"
#include "gpu_anchors.h"

/* Returns a scene that has no memory, but its networks' shapes. */
static saga_scene shape_of(const saga_model *model, saga_counts n)
{
    saga_scene s = { .model = *model, .n = n };

    for (int i = 0; i < SAGA_N_NETS; i++)
        saga_scene_shape(&s.net[i], model, i);
    return s;
}

/* What an iteration has that stays on the device (fit_stay.c). If the model
 * shares anchors, none does. */
static bool stay_room(saga_gpu *gpu, saga_gpu_canvas *g,
                      const saga_canvas *canvas, saga_scene *s,
                      saga_error *error)
{
    const saga_gpu_turn turn = { .n = s->n.prim,
                                 .features = s->model.features,
                                 .fine = &s->net[SAGA_NET_FINE],
                                 .d_fine = &s->net[SAGA_NET_FINE],
                                 .base = saga_away_n_params(s) };

    return s->n.coarse < s->n.prim || s->n.fine < s->n.prim ||
           (saga_gpu_anchors_room(g, &turn, error) &&
            saga_away_room(gpu, g, canvas, s, error) &&
            saga_away_rate_room(gpu, g, s, error));
}

bool saga_fit_room(saga_gpu *gpu, const saga_pictures *pictures,
                   const saga_canvas *canvas, const saga_model *model,
                   saga_counts n, saga_error *error)
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
    const bool ok = g && saga_gpu_pictures_room(g, error) &&
                    saga_gpu_learn_room(
                        g, canvas, saga_attrs_of_tools(model->tools, false),
                        n.prim, error) &&
                    (!has || (blocks && stay_room(gpu, g, canvas, &s, error) &&
                              saga_gpu_blocks_plan(blocks, &features, error)));

    saga_gpu_blocks_free(blocks);
    saga_gpu_canvas_free(g);
    return ok;
}
