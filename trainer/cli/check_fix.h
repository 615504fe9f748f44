/* SPDX-License-Identifier: MIT
 *
 * Rewrites a transforms.json whose cameras do not fit its pictures, without the
 * mistake that the survey has found, or with cameras that it has refined.
 */
#ifndef SAGA_CHECK_FIX_H
#define SAGA_CHECK_FIX_H

#include "capture.h"
#include "survey.h"

/* Writes the corrected file to `path`, completely or not at all; if there is
 * nothing to correct, says so on stderr and writes nothing. `name` is the
 * capture: a folder with transforms.json, or such a file. Everything in the
 * file that does not describe cameras is kept. Returns false on an error. */
bool saga_check_fix(const char *path, const char *name,
                    const saga_survey *survey, const saga_capture *capture,
                    saga_error *error);

#endif
