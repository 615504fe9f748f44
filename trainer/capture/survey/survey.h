/* SPDX-License-Identifier: MIT
 *
 * A survey of a loaded capture finds, before any training, what will go wrong:
 * cameras that have nothing in common or are far apart, poses that do not fit
 * the points, exposures that differ, cameras that run late.
 *
 * It uses places: the capture's points or, without points, a grid on the rays
 * of every camera, at the depth where the cameras look. Occlusion is not known,
 * so that only medians of colours are used. Whether poses and lenses fit the
 * pictures is found by matches, with or without points.
 */
#ifndef SAGA_SURVEY_H
#define SAGA_SURVEY_H

#include "calibration.h"
#include "capture.h"
#include "lateness.h"
#include "looks.h"

typedef struct saga_survey_view {
    int nearest;    /* nearest view by angle; -1: none */
    double step;    /* distance to it, as a part of that to the middle of
                     * the places */
    double angle;   /* angle to it in degrees, from the middle of the
                     * places; NaN: there is only one camera */
    double overlap; /* part of the places it sees that the view with most
                     * in common sees too; NaN: one camera */
    double seen;    /* part of all places that it sees */
    double stops;   /* exposure relative to the others, as log2 of light,
                     * at points, otherwise at matches; NaN: unknown */
    double colour;  /* median difference from the others, where stops are
                     * measured and once exposure is corrected, in 8-bit
                     * levels; NaN: unknown */
    double swapped; /* the same with red and blue exchanged, as a part of
                     * it; NaN: unknown */
    saga_look look;
    saga_lateness late;
} saga_survey_view;

typedef struct saga_survey {
    saga_survey_view *views; /* (n_views of the capture) */
    saga_calibration calibration;
    double typical_angle;          /* median of the views' angles; NaN: one
                                    * view */
    bool free_views;               /* views between the cameras may be good; if
                                    * one camera moves, of what stands still */
    size_t wrong_nbytes;           /* length of the first notes, those about
                                    * cameras whose pictures are wrong */
    char notes[SAGA_NOTES_NBYTES]; /* lines, the worst first; notes of a kind
                                    * are one line */
} saga_survey;

/* Surveys a capture. The caller frees *survey by saga_survey_free, also after a
 * failure. */
bool saga_survey_make(saga_survey *survey, const saga_capture *capture,
                      saga_error *error);
void saga_survey_free(saga_survey *survey);

#endif
