/* SPDX-License-Identifier: MIT
 *
 * Blending sorted splats into a rectangle of pixels, front to back, exact for
 * any tile size, list capacity, band width and division among threads.
 */
#ifndef SAGA_RASTER_H
#define SAGA_RASTER_H

#include "cpu.h"
#include "depth_sort.h"
#include "saga.h"

/* A view, as it is drawn. */
typedef struct saga_drawing {
    const saga_camera *cam;      /* size and background */
    const saga_splat *splats;
    const saga_key *order;       /* (n) prepared: splats[order[i].index] is
                                  * drawn i-th */
    uint32_t n;
    saga_cpu cpu;                /* vectors to use; this machine has them */
    uint32_t tools;              /* of the file, SAGA_TOOL_* */
} saga_drawing;

/* Prepares keys in drawing order, sorted by (depth, index), for saga_raster:
 * in place of a depth comes the splat's box, coarsely. cam gives the size.
 * Returns the pixels of all boxes, added up. */
uint64_t saga_raster_boxes(saga_key *order, const saga_splat *splats,
                           uint32_t n, const saga_camera *cam);

/* Draws some of a job. Checks job and pic (ARG, SPACE, ALIGN).
 * budget bounds the work of this call: one unit is one splat looked at or one
 * row of a splat in a tile blended (up to 64 pixels). Returns SAGA_OK when the
 * job is finished, SAGA_AGAIN when the budget was spent; progress is made for
 * every budget >= 1. Pixels outside the job's rectangle are never written;
 * pixels inside are written once, when final. */
saga_status saga_raster(saga_job *job, const saga_picture *pic,
                        const saga_drawing *drawing, uint32_t budget);

#endif
