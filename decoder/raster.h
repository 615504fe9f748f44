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

/* The parts of a view that drawing needs. */
typedef struct saga_drawing {
    const saga_camera *cam; /* size and background */
    const saga_splat *splats;
    const saga_key *order; /* (n) from saga_raster_boxes:
                            * splats[order[i].index] is drawn i-th */
    uint32_t n;
    saga_cpu cpu;   /* SIMD to use, which this machine has */
    uint32_t tools; /* the file's SAGA_TOOL_* */
} saga_drawing;

/* Prepares keys, sorted by (depth, index), for saga_raster: replaces the depth
 * in each key by the splat's box in coarse units. cam gives the picture's size.
 * Returns the number of pixels in all boxes together. */
uint64_t saga_raster_boxes(saga_key *order, const saga_splat *splats,
                           uint32_t n, const saga_camera *cam);

/* Draws a part of a job. Checks job and pic, and returns ARG, SPACE or ALIGN if
 * they are invalid. budget bounds the work of the call: one unit is one test of
 * a splat, or one row of a splat blended in a tile (up to 64 pixels). Returns
 * SAGA_OK when the job is finished, SAGA_AGAIN when the budget is used up. Any
 * budget >= 1 makes progress. Pixels outside the job's rectangle are never
 * written; pixels inside are written once, with their final values. */
saga_status saga_raster(saga_job *job, const saga_picture *pic,
                        const saga_drawing *drawing, uint32_t budget);

#endif
