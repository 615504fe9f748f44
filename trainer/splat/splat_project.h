/* SPDX-License-Identifier: MIT
 *
 * Goes from primitives at a time to splats in a camera: EWA projection with
 * the norm's rules (docs/arithmetic.md: camera, projection, splat).
 */
#ifndef SAGA_SPLAT_PROJECT_H
#define SAGA_SPLAT_PROJECT_H

#include "splat.h"

#define saga_splat_project_forward SAGA_REAL_NAME(saga_splat_project_forward)
#define saga_splat_project_backward SAGA_REAL_NAME(saga_splat_project_backward)

/* The calls below work on some of the primitives, by one thread: others may do
 * others.
 *
 * Projects canvas->splat.posed to .splat and .extent, which are empty (x1 = x0)
 * and 0 where a primitive is dropped or misses the picture. */
void saga_splat_project_forward(saga_canvas *canvas,
                                const saga_splat_params *p, saga_range of);

/* Sums the records of visible splats in tile order and carries them back: SETS
 * canvas->splat.d_posed of visible primitives, ADDS to d->log2_scale and
 * d->colour, and to stats (NULL: none). */
void saga_splat_project_backward(saga_splat_params *d,
                                 saga_splat_stats *stats,
                                 saga_canvas *canvas,
                                 const saga_splat_params *p, saga_range of);

#endif
