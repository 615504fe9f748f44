/* SPDX-License-Identifier: MIT
 *
 * Splits a segment into layers. Its file may be cut behind any of them.
 */
#ifndef SAGA_LAYERS_H
#define SAGA_LAYERS_H

#include "hierarchy.h"
#include "pictures.h"
#include "scene.h"
#include "splat.h"

typedef struct saga_layers_terms {
    uint32_t n_layers; /* 1..SAGA_MAX_LAYERS */
    const saga_pictures *pictures;
    saga_splat_params flat; /* the warm-up's n primitives, which are sorted
                             * by the light that they add to the
                             * pictures */
    uint32_t n;
} saga_layers_terms;

/* Builds a scene of all layers from the pool, whose primitives correspond to
 * the n of *terms. Budgets and model are from *o. source is as prim_origin of
 * saga_hierarchy_build. Returns false with *error set if memory is short. */
bool saga_layers_build(saga_scene *s, uint32_t *source,
                       const saga_layers_terms *terms,
                       const saga_hierarchy_pool *pool,
                       const saga_hierarchy_options *o, saga_error *error);

#endif
