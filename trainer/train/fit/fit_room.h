/* SPDX-License-Identifier: MIT
 *
 * The room on a device that the rendering stage takes.
 */
#ifndef SAGA_FIT_ROOM_H
#define SAGA_FIT_ROOM_H

#include "gpu_splat.h"
#include "scene.h"

/* Makes and frees, on a device that counts (saga_gpu_count), what a fit of n
 * anchors and primitives of this model makes there, with n_teachers of a still.
 * The canvas has the size of the largest picture. Returns false with *error set
 * if the device cannot have a buffer of that size. */
bool saga_fit_room(saga_gpu *gpu, const saga_pictures *pictures,
                   const saga_canvas *canvas, const saga_model *model,
                   saga_counts n, int n_teachers, saga_error *error);

#endif
