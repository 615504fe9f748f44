/* SPDX-License-Identifier: MIT
 *
 * An iteration of the rendering stage whose anchors are on the device
 * (gpu_anchors.h): values, the picture, the rate, and the steps of features and
 * positions, in one list of commands.
 */
#ifndef SAGA_GPU_ITERATE_H
#define SAGA_GPU_ITERATE_H

#include "gpu_anchors.h"
#include "gpu_networks.h"
#include "gpu_rates.h"

typedef struct saga_gpu_iteration {
    const saga_gpu_turn *turn;
    const saga_gpu_prims *prims; /* those that are drawn */
    const saga_gpu_rates *rates;
} saga_gpu_iteration;

/* Does an iteration for the truth of saga_gpu_show. Adds to the gradients of
 * the networks, sets the bits of i->rates and *mse. Fails too if a number is
 * not finite. */
bool saga_gpu_iterate(saga_gpu_canvas *g, saga_gpu_blocks *b, double *mse,
                      const saga_gpu_iteration *i, const saga_canvas *canvas,
                      saga_error *error);

/* Makes what that needs besides blocks, for a plan (gpu_splat.h). Networks need
 * no weights; of a turn only n, features, base and the shape of F_fine count.
 */
bool saga_gpu_iteration_room(saga_gpu_canvas *g, const saga_gpu_iteration *i,
                             const saga_canvas *canvas, saga_error *error);

#endif
