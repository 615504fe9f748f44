/* SPDX-License-Identifier: MIT
 *
 * The built-in room as a fixture: the *state of all tests of a program.
 */
#ifndef SYNTH_FIXTURE_H
#define SYNTH_FIXTURE_H

#include "capture_files.h"
#include "survey.h"
#include "synth_capture.h"

/* Makes the capture, in a folder that is removed before the tests begin. */
static inline int synth_enter(void **state, const saga_synth_options *s)
{
    saga_capture *const c = must(malloc(sizeof *c));
    void *f;

    if (folder_make(&f))
        return 1;
    *c = synth_capture(folder_file(f, "room"), s);
    *state = c;
    return folder_remove(&f);
}

static inline int synth_leave(void **state)
{
    saga_capture_free(*state);
    free(*state);
    return 0;
}

/* Tells whether a note of a survey contains `what`. */
static inline bool says(const saga_survey *s, const char *what)
{
    return strstr(s->notes, what) != NULL;
}

#endif
