/* SPDX-License-Identifier: MIT
 *
 * Writes the findings of `saga check` as one self-contained page, and computes
 * its forecast, which is also printed as text.
 */
#ifndef SAGA_CHECK_PAGE_H
#define SAGA_CHECK_PAGE_H

#include "capture.h"
#include "device_room.h"
#include "survey.h"

typedef struct saga_forecast {
    const char *preset;
    int n_segments;
    int scale; /* a still's pictures are used at 1/scale of their size */
    int n_primitives, n_iterations; /* numbers for each segment */
    int level;
    double n_wanted; /* primitives that suit the capture, if the level
                      * has no room for them; otherwise 0 */
    int n_teachers;  /* trained before the warm-up; counted in `minutes` only */
    double minutes;  /* CPU time for all segments */
    double least_kb, most_kb;
    double memory_nbytes;    /* of training a segment, besides its pictures */
    double picture_nbytes;   /* of a segment's pictures and masks, decoded */
    saga_device_room device; /* all 0 without a device, or if it cannot have a
                              * buffer */
    saga_error lacks; /* why that or another device is needed, or empty */
} saga_forecast;

/* Estimates what encoding with preset number `index` takes, on the assumption
 * that a base saves nothing; gpu: the device that trains, or NULL. Returns
 * false past the last preset, or if memory is short. */
bool saga_forecast_of(saga_forecast *forecast, const saga_capture *capture,
                      int index, saga_gpu *gpu);

/* Writes the page, completely or not at all. `name` is the capture; gpu: the
 * device that trains, or NULL. */
bool saga_check_page(const char *path, const char *name,
                     const saga_survey *survey, const saga_capture *capture,
                     saga_gpu *gpu, saga_error *error);

#endif
