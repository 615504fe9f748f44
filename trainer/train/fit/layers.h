/* SPDX-License-Identifier: MIT
 *
 * A segment may have layers, behind each of which its file may be cut.
 */
#ifndef SAGA_LAYERS_H
#define SAGA_LAYERS_H

#include "hierarchy.h"
#include "pictures.h"
#include "scene.h"
#include "splat.h"

typedef struct saga_layers_terms {
    uint32_t n_layers;           /* 1..SAGA_MAX_LAYERS */
    const saga_pictures *pictures;
    saga_splat_params flat;      /* (n) the warm-up's primitives, whose light */
    uint32_t n;                  /* in the pictures says which come first */
} saga_layers_terms;

/* Builds the scene of all layers from the pool, which has the n primitives as
 * they are to be; budgets and model are o's; source as saga_hierarchy_build's
 * prim_origin. */
bool saga_layers_build(saga_scene *s, uint32_t *source,
                       const saga_layers_terms *terms,
                       const saga_hierarchy_pool *pool,
                       const saga_hierarchy_options *o, saga_error *error);

#endif
