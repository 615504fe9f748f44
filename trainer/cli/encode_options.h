/* SPDX-License-Identifier: MIT
 *
 * The options of saga encode. The table of encode_cli.c reads it and is its
 * help; ranges stand there, defaults in saga_encode_defaults.
 *
 * Who decides: what is given goes before the preset, and the preset before the
 * rule that follows from the capture (preset.h). The level's limits go
 * before all.
 */
#ifndef SAGA_ENCODE_OPTIONS_H
#define SAGA_ENCODE_OPTIONS_H

#include "ablation.h"
#include "capture_cli.h"
#include "error.h"
#include "preset.h"

#include <jansson.h>

typedef struct saga_encode_options {
    saga_capture_choice capture;
    const char *output;      /* file, or folder of a sweep; needed */

    /* How large, how long. One of lambda, size, bitrate and sweep decides on
     * the size; 0: not given. */
    const char *preset;      /* what is not given of the following */
    double size;             /* bytes */
    double bitrate;          /* bits a second, over the capture's time */
    bool sweep;              /* five files, by their primitives */
    int primitives;          /* of a segment; 0: by size, or by the preset */
    int iterations;          /* of a segment, all stages; 0: by the preset */
    double minutes;          /* instead of iterations; 0: these */
    double lambda;           /* price of a bit (policy.h); 0: balanced */
    int level;               /* 0 to 3; obeyed by all that is planned */
    int layers;              /* behind which a file may be cut */

    /* Which part. */
    int segment;             /* frames; 0: preset.h */
    bool networks_only;      /* no segments: the file that --networks takes */
    int only;                /* segment; -1: all. Needs networks */
    const char *networks;    /* file, or NULL */

    /* How. */
    double metres;           /* in the capture's unit; 0: the capture says */
    bool still, moving;      /* instead of a measurement */
    int seed;
    const char *ablate;      /* words of ablation.h, or NULL */

    /* Beside the file. */
    int every;               /* seconds between checkpoints */
    bool resume;
    const char *log;         /* file, or NULL */
    bool json;               /* what is printed */
} saga_encode_options;

saga_encode_options saga_encode_defaults(void);

/* Not all of the capture's file is made. */
bool saga_encode_is_part(const saga_encode_options *o);

/* Says what excludes what, and reads preset and ablation. The exit status. */
int saga_encode_check_options(const saga_encode_options *o,
                              const saga_preset **preset,
                              saga_ablation *ablation);

/* Returns what decides on the file, as it was given: 0, null and false stand
 * for what was not. */
json_t *saga_encode_options_json(const saga_encode_options *o);

#endif
