/* SPDX-License-Identifier: MIT
 *
 * Options that all commands share that load a capture.
 */
#ifndef SAGA_CAPTURE_CLI_H
#define SAGA_CAPTURE_CLI_H

#include "capture_load.h"
#include "cli.h"

typedef struct saga_capture_choice {
    saga_cli_pair frames; /* frames a to b - 1; b = 0: to the last */
    const char *hold_out, *late, *scratch;
    int scale; /* 1/scale of the size; 0: not given */
    int memory, threads;
    bool alpha_masks, subject, follow_paths;
    saga_cli_rgb key; /* implies subject */
} saga_capture_choice;

/* The choice if no option is given. */
#define SAGA_CAPTURE_CHOICE \
    {                       \
        .memory = 4         \
    }

/* Rows for a command's table of options, whose structure `type` holds the
 * choice in its `member`. */
#define SAGA_CAPTURE_OPTIONS(type, member)                                   \
    { "--frames",                                                            \
      "A:B",                                                                 \
      "use frames A to B - 1 of the capture (default: "                      \
      "all)",                                                                \
      saga_cli_range,                                                        \
      offsetof(type, member.frames),                                         \
      0,                                                                     \
      SAGA_MAX_FRAMES },                                                     \
        { "--scale",                                                         \
          "1/N",                                                             \
          "shrink the pictures to 1/N of their width and "                   \
          "height, by\naveraging boxes of N x N pixels",                     \
          saga_cli_scale,                                                    \
          offsetof(type, member.scale),                                      \
          1,                                                                 \
          SAGA_MAX_SCALE },                                                  \
        { "--hold-out",                                                      \
          "NAME,..",                                                         \
          "cameras to keep from training, to judge "                         \
          "the result by;\n\"\" for none (default: those that the capture "  \
          "names)",                                                          \
          saga_cli_names,                                                    \
          offsetof(type, member.hold_out),                                   \
          0,                                                                 \
          0 },                                                               \
        { "--late",                                                          \
          "NAME=N,..",                                                       \
          "cameras that are N frames behind the others; "                    \
          "N may be a\nfraction, such as 0.5",                               \
          saga_cli_text,                                                     \
          offsetof(type, member.late),                                       \
          0,                                                                 \
          0 },                                                               \
        { "--alpha-masks",                                                   \
          NULL,                                                              \
          "ignore pixels of alpha below 128; "                               \
          "without this,\npictures lie over black",                          \
          saga_cli_flag,                                                     \
          offsetof(type, member.alpha_masks),                                \
          0,                                                                 \
          0 },                                                               \
        { "--subject",                                                       \
          NULL,                                                              \
          "keep only what the masks, or else the pictures' alpha,\n"         \
          "show, and make everything else transparent; masks may\n"          \
          "have values between black and white",                             \
          saga_cli_flag,                                                     \
          offsetof(type, member.subject),                                    \
          0,                                                                 \
          0 },                                                               \
        { "--key",                                                           \
          "RRGGBB",                                                          \
          "as --subject, but keep what has not the colour of a\n"            \
          "green or blue screen, as two hex digits for red, green\n"         \
          "and blue",                                                        \
          saga_cli_colour,                                                   \
          offsetof(type, member.key),                                        \
          0,                                                                 \
          0 },                                                               \
        { "--follow-paths",                                                  \
          NULL,                                                              \
          "read files outside the capture's folder if "                      \
          "it names them\nby an absolute path or by ..; symbolic links are " \
          "always\nfollowed",                                                \
          saga_cli_flag,                                                     \
          offsetof(type, member.follow_paths),                               \
          0,                                                                 \
          0 },                                                               \
        { "--memory",                                                        \
          "GIB",                                                             \
          "most memory to use, in GiB (default 4), without the\n"            \
          "pages of the scratch file, which the system may drop",            \
          saga_cli_int,                                                      \
          offsetof(type, member.memory),                                     \
          1,                                                                 \
          1 << 16 },                                                         \
        { "--scratch",                                                       \
          "DIR",                                                             \
          "keep decoded pictures in a file in DIR, which has no\n"           \
          "name and ends with the program. Without this option,\n"           \
          "only if they take over a quarter of --memory",                    \
          saga_cli_text,                                                     \
          offsetof(type, member.scratch),                                    \
          0,                                                                 \
          0 },                                                               \
    {                                                                        \
        "--threads", "N",                                                    \
            "number of threads (default: all cores); the "                   \
            "result does\nnot depend on it",                                 \
            saga_cli_int, offsetof(type, member.threads), 1, 1024            \
    }

/* Tells whether a subject is wanted, by masks or by a key. */
static inline bool saga_capture_of_subject(const saga_capture_choice *choice)
{
    return choice->subject || choice->key.given;
}

/* Returns the options for loading; `progress` is not set. If no folder is
 * chosen, the scratch file is in TMPDIR, or in /var/tmp: /tmp is often in
 * memory. */
saga_capture_options saga_capture_chosen(const saga_capture_choice *choice);

#endif
