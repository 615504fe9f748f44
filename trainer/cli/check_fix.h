/* SPDX-License-Identifier: MIT
 *
 * Writes a transforms.json for a capture whose cameras do not fit its pictures,
 * without the mistake that the survey has found, or with cameras that it has
 * refined.
 */
#ifndef SAGA_CHECK_FIX_H
#define SAGA_CHECK_FIX_H

#include "capture.h"
#include "survey.h"

/* Writes the file to `path`, completely or not at all, with the capture's
 * points, if there are any, beside it ("x.json.ply" beside "x.json"); if there
 * is nothing to correct, says so on stderr and writes nothing. `name` is the
 * capture, of any layout, and `options` are those it was loaded with. Returns
 * false on an error. */
bool saga_check_fix(const char *path, const char *name,
                    const saga_capture_options *options,
                    const saga_survey *survey, const saga_capture *capture,
                    saga_error *error);

#endif
