/* SPDX-License-Identifier: MIT
 *
 * The built-in room as the *state of tests.
 */
#ifndef SYNTH_FIXTURE_H
#define SYNTH_FIXTURE_H

#include "capture_files.h"
#include "synth_capture.h"

/* Makes it in a folder that is gone again when the tests begin. */
static inline int synth_enter(void **state,
                                      const saga_synth_options *s)
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

#endif
