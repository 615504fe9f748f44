/* SPDX-License-Identifier: MIT
 *
 * Blending sorted splats into a rectangle of pixels, front to back, exact for
 * any tile size, list capacity, band width and division among threads.
 */
#ifndef SAGA_RASTER_H
#define SAGA_RASTER_H

#include "depth_sort.h"
#include "saga.h"

/* splats[order[i].index], i = 0..n-1, are the splats in drawing order.
 * cam gives size and background. Checks job and pic (ARG, SPACE, ALIGN).
 * budget bounds the work of this call: one unit is one splat looked at or one
 * row of a splat in a tile blended (up to 64 pixels). Returns SAGA_OK when the
 * job is finished, SAGA_AGAIN when the budget was spent; progress is made for
 * every budget >= 1. Pixels outside the job's rectangle are never written;
 * pixels inside are written once, when final. */
saga_status saga_raster(saga_job *job, const saga_picture *pic,
                        const saga_camera *cam, const saga_splat *splats,
                        const saga_key *order, uint32_t n, uint32_t budget);

#endif
