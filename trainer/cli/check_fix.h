/* SPDX-License-Identifier: MIT
 *
 * A transforms.json whose cameras do not fit its pictures is written again
 * without the mistake that the survey has found.
 */
#ifndef SAGA_CHECK_FIX_H
#define SAGA_CHECK_FIX_H

#include "capture.h"
#include "survey.h"

/* Writes the file, whole or not at all; without a mistake it says so on stderr
 * and writes none. name is the capture's: a folder with transforms.json, or
 * such a file. What stands there that is not the cameras' stays. */
bool saga_check_fix(const char *path, const char *name,
                    const saga_survey *survey, const saga_capture *capture,
                    saga_error *error);

#endif
