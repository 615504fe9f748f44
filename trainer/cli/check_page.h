/* SPDX-License-Identifier: MIT
 *
 * The findings of saga check, as one page without other files; and the
 * forecast, which it tells in text as well.
 */
#ifndef SAGA_CHECK_PAGE_H
#define SAGA_CHECK_PAGE_H

#include "capture.h"
#include "survey.h"

typedef struct saga_forecast {
    const char *preset;
    int n_segments;
    int scale;                /* N of 1/N that pictures of a still are at */
    int n_primitives, n_iterations; /* of each */
    int n_teachers;           /* before the warm-up, counted in minutes alone */
    double minutes;           /* of CPU, for all of them */
    double least_kb, most_kb;
} saga_forecast;

/* Tells what encoding with the index-th preset takes, with a base that saves
 * nothing; false past the last, and where memory ends. */
bool saga_forecast_of(saga_forecast *forecast, const saga_capture *capture,
                      int index);

/* Writes the page; it appears whole or not at all. name is the capture's. */
bool saga_check_page(const char *path, const char *name,
                     const saga_survey *survey, const saga_capture *capture,
                     saga_error *error);

#endif
