/* SPDX-License-Identifier: MIT
 *
 * Projects posed primitives to splats in a camera, by EWA projection with the
 * rules of docs/arithmetic.md (camera, projection, splat).
 */
#ifndef SAGA_SPLAT_PROJECT_H
#define SAGA_SPLAT_PROJECT_H

#include "isa.h"
#include "splat.h"

#define saga_splat_project_forward SAGA_ISA_NAME(saga_splat_project_forward)
#define saga_splat_project_backward SAGA_ISA_NAME(saga_splat_project_backward)

/* Both functions work on a range of primitives on one thread; other threads may
 * do other ranges.
 *
 * Projects canvas->splat.posed to .splat and .extent. For a primitive that is
 * dropped or outside the picture, the splat is empty (x1 = x0) and the extent
 * 0. */
extern void saga_splat_project_forward(saga_canvas *canvas,
                                       const saga_splat_params *p,
                                       saga_range of);

/* Sums the records of visible splats in tile order, and takes the gradients
 * further back. It SETS canvas->splat.d_posed of visible primitives, and ADDS
 * to d->log2_scale, d->colour and stats (which may be NULL). */
extern void saga_splat_project_backward(saga_splat_params *d,
                                        saga_splat_stats *stats,
                                        saga_canvas *canvas,
                                        const saga_splat_params *p,
                                        saga_range of);

#endif
