/* SPDX-License-Identifier: MIT
 *
 * The judgements of a survey: notes in words, by the limits in survey_judge.c.
 */
#ifndef SAGA_SURVEY_JUDGE_H
#define SAGA_SURVEY_JUDGE_H

#include "survey.h"

enum {
    SAGA_FEW_PLACES = 8 /* with fewer points or rays nothing is reported */
};

/* Adds notes to a survey whose measurements are complete. */
void saga_survey_judge(saga_survey *survey, const saga_capture *capture);

#endif
