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
    const saga_twin *twin;
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

/* Tells whether the device can run the networks of the scene's primitives,
 * which the links of the twin's last refresh decide, too. */
bool saga_away_can(const saga_gpu *gpu, const saga_away *a);

/* Draws the first n primitives as seen by the canvas's camera, compares with
 * the truth of saga_gpu_show, and adds the gradients of networks, with those of
 * saga_twin_size_loss. Sets *mse. */
bool saga_away_learn(saga_gpu_canvas *g, double *mse, const saga_away *a,
                     uint32_t n, const saga_canvas *canvas, saga_error *error);

/* Makes the room that this takes on a device that can do it, for a plan
 * (gpu_splat.h): of the scene only model, counts and shapes of networks count.
 */
bool saga_away_room(const saga_gpu *gpu, saga_gpu_canvas *g,
                    const saga_canvas *canvas, saga_scene *s,
                    saga_error *error);

#endif
