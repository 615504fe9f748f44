/* SPDX-License-Identifier: MIT
 *
 * Judges whether each camera shows the scene that the others show. A camera
 * that is dead, or that films something else, is worse than none.
 */
#ifndef SAGA_SURVEY_PICTURES_H
#define SAGA_SURVEY_PICTURES_H

#include "survey.h"

/* Adds notes about cameras whose pictures are wrong. All measurements are
 * complete. Returns false if memory is short. */
bool saga_survey_judge_pictures(saga_survey *survey,
                                const saga_capture *capture, saga_error *error);

#endif
