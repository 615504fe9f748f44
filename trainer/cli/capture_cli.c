/* SPDX-License-Identifier: MIT */
#include "capture_cli.h"

#include <stdlib.h>
#include <string.h>

saga_capture_options saga_capture_chosen(const saga_capture_choice *choice)
{
    saga_capture_options o = saga_capture_defaults();
    const char *const folder = getenv("TMPDIR");

    o.scale = choice->scale ? choice->scale : 1;
    o.first_frame = choice->frames.a;
    o.end_frame = choice->frames.b;
    o.hold_out = choice->hold_out;
    o.late = choice->late;
    o.alpha_masks = choice->alpha_masks;
    o.subject = saga_capture_of_subject(choice);
    o.keyed = choice->key.given;
    memcpy(o.key, choice->key.rgb, sizeof o.key);
    o.follow_paths = choice->follow_paths;
    o.memory_nbytes = (uint64_t)choice->memory << 30;
    o.scratch = choice->scratch     ? choice->scratch
                : folder && *folder ? folder
                                    : "/var/tmp";
    o.little_nbytes = choice->scratch ? 0 : o.memory_nbytes / 4;
    o.n_threads = choice->threads;
    return o;
}
