/* SPDX-License-Identifier: MIT
 *
 * Options that all commands share that load a capture.
 */
#ifndef SAGA_CAPTURE_CLI_H
#define SAGA_CAPTURE_CLI_H

#include "capture_load.h"
#include "cli.h"

typedef struct saga_capture_choice {
    saga_cli_pair frames;    /* frames a to b - 1; b = 0: to the last */
    const char *hold_out, *late;
    int scale;               /* 1/scale of the size; 0: not given */
    int memory, threads;
    bool alpha_masks, follow_paths;
} saga_capture_choice;

/* The choice if no option is given. */
#define SAGA_CAPTURE_CHOICE { .memory = 4 }

/* Rows for a command's table of options, whose structure `type` holds the
 * choice in its `member`. */
#define SAGA_CAPTURE_OPTIONS(type, member) \
    { "--frames", "A:B", "frames A to B - 1 of the capture (default all)", \
      saga_cli_range, offsetof(type, member.frames), 0, SAGA_MAX_FRAMES }, \
    { "--scale", "1/N", "pictures made smaller by means of N x N boxes", \
      saga_cli_scale, offsetof(type, member.scale), 1, SAGA_MAX_SCALE }, \
    { "--hold-out", "NAME,..", "views not to be trained on, \"\" for none " \
      "(default:\nwhat the capture says)", saga_cli_names, \
      offsetof(type, member.hold_out), 0, 0 }, \
    { "--late", "NAME=N,..", "cameras that run N frames, also parts of one, " \
      "behind the\nothers", saga_cli_text, offsetof(type, member.late), 0, \
      0 }, \
    { "--alpha-masks", NULL, "what is transparent in PNG pictures does not " \
      "count;\nwithout this it is black", saga_cli_flag, \
      offsetof(type, member.alpha_masks), 0, 0 }, \
    { "--follow-paths", NULL, "read files outside of the capture's folder " \
      "where it names\nsome, absolute or by ..; links are always " \
      "followed", saga_cli_flag, offsetof(type, member.follow_paths), 0, 0 }, \
    { "--memory", "GIB", "memory for pictures loaded at a time (default 4)", \
      saga_cli_int, offsetof(type, member.memory), 1, 1 << 16 }, \
    { "--threads", "N", "threads (default: all cores); no effect on what " \
      "comes out", saga_cli_int, offsetof(type, member.threads), 1, 1024 }

/* Returns the options for loading; `progress` is not set. */
saga_capture_options saga_capture_chosen(const saga_capture_choice *choice);

#endif
