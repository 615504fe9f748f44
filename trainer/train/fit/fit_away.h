/* SPDX-License-Identifier: MIT
 *
 * The networks of primitives on a device, which has the fine anchors and keeps
 * their gradients (gpu_anchors.h).
 */
#ifndef SAGA_FIT_AWAY_H
#define SAGA_FIT_AWAY_H

#include "gpu_networks.h"
#include "twin.h"

/* A scene as a device learns it. */
typedef struct saga_away {
    const saga_scene *scene; /* that the twin runs */
    saga_scene *d;           /* gradients of its networks */
    real size_price;         /* of saga_twin_size_loss */
} saga_away;

/* Sets level (n.prim, 2) to the constants between log2 sizes and outputs of
 * networks, in space and in time. */
void saga_away_levels(real *level, const saga_scene *s);

/* Sets limit (n.prim) to the outputs that give the log2 sizes `most`. */
void saga_away_limits(real *limit, const real *most, const real *level,
                      uint32_t n);

/* Returns the number of parameters of these networks. */
uint32_t saga_away_n_params(const saga_scene *s);

/* Tells whether the device can run the networks of the scene's primitives, if
 * these read anchors of their own alone (saga_twin.whole). */
bool saga_away_can(const saga_gpu *gpu, const saga_away *a);

/* The networks of primitives for a device. It is not to be moved, since the
 * first member points to others. */
typedef struct saga_away_prims {
    saga_gpu_prims to;
    saga_attr_part part[SAGA_GPU_MOST_GEO];
} saga_away_prims;

/* Sets p to those of the first n primitives, which add the gradients of
 * networks, with those of saga_twin_size_loss. */
void saga_away_list_prims(saga_away_prims *p, const saga_away *a, uint32_t n);

#endif
