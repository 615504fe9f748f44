/* SPDX-License-Identifier: MIT */
#include "capture_cli.h"

saga_capture_options saga_capture_chosen(const saga_capture_choice *choice)
{
    saga_capture_options o = saga_capture_defaults();

    o.scale = choice->scale ? choice->scale : 1;
    o.first_frame = choice->frames.a;
    o.end_frame = choice->frames.b;
    o.hold_out = choice->hold_out;
    o.late = choice->late;
    o.alpha_masks = choice->alpha_masks;
    o.follow_paths = choice->follow_paths;
    o.memory_nbytes = (uint64_t)choice->memory << 30;
    o.n_threads = choice->threads;
    return o;
}
