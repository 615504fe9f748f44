/* SPDX-License-Identifier: MIT
 *
 * A survey of a loaded capture finds out before any training what will go
 * wrong: cameras that see nothing in common or stand far apart, poses that do
 * not fit the points, exposures that differ, cameras that run late.
 *
 * It looks at places: the capture's points, or without them a grid of rays of
 * every camera, ended where the cameras look. Nothing tells what hides a place,
 * so all that is said of colours is a median. Whether poses and lenses fit the
 * pictures is found from matches between these, with points or without.
 */
#ifndef SAGA_SURVEY_H
#define SAGA_SURVEY_H

#include "calibration.h"
#include "capture.h"
#include "lateness.h"

enum { SAGA_SURVEY_NOTES = 16, SAGA_SURVEY_NOTE_NBYTES = 400 };

typedef struct saga_survey_view {
    int nearest;         /* view that stands nearest by angle, -1: none */
    double angle;        /* to it, degrees, from the middle of the places; NaN
                          * of one camera alone, as is: */
    double overlap;      /* share of the places it sees that the view with most
                          * in common sees too */
    double seen;         /* share of all places that it sees */
    double stops;        /* exposure against the others: log2 of light, at
                          * points, or without them at matches; NaN: unknown */
    double colour;       /* median difference to the others at the places after
                          * that, 8-bit levels; NaN: unknown */
    saga_lateness late;
} saga_survey_view;

typedef struct saga_survey {
    saga_survey_view *views;     /* (n_views of the capture) */
    saga_calibration calibration;
    double typical_angle;        /* median of the views' angles; NaN of one */
    bool free_views;             /* what is between the cameras may be good, of
                                  * what stands still where one camera moves */
    int n_notes;                 /* what to mind, worst first */
    char note[SAGA_SURVEY_NOTES][SAGA_SURVEY_NOTE_NBYTES];
} saga_survey;

/* Fills *survey; saga_survey_free frees it, also after a failure. */
bool saga_survey_make(saga_survey *survey, const saga_capture *capture,
                      saga_error *error);
void saga_survey_free(saga_survey *survey);

#endif
