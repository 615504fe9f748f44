/* SPDX-License-Identifier: MIT
 *
 * From primitives at a time to splats in a camera: EWA projection with the
 * norm's rules (docs/arithmetic.md: camera, projection, splat).
 */
#ifndef SAGA_SPLAT_PROJECT_H
#define SAGA_SPLAT_PROJECT_H

#include "splat.h"

#define saga_splat_project_forward SAGA_REAL_NAME(saga_splat_project_forward)
#define saga_splat_project_backward SAGA_REAL_NAME(saga_splat_project_backward)

/* out[i] is empty (x1 = x0) and extent[i] 0 where a primitive is dropped or
 * misses the picture. */
void saga_splat_project_forward(saga_splat_2d *out, real *extent,
                                const saga_splat_posed *posed,
                                const saga_splat_params *p, uint32_t n,
                                const saga_splat_camera *cam,
                                const saga_splat_rules *rules);

/* Sums the records of work's visible splats in tile order and carries them
 * back: SETS d_posed of visible primitives, ADDS to d->log2_scale and
 * d->colour, and to stats (NULL: none). */
void saga_splat_project_backward(saga_splat_posed *d_posed,
                                 saga_splat_params *d,
                                 saga_splat_stats *stats,
                                 const saga_splat_work *work,
                                 const saga_splat_params *p,
                                 const saga_splat_camera *cam);

#endif
