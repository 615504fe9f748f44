/* SPDX-License-Identifier: MIT
 *
 * The options of `saga encode`. The table in encode_cli.c reads them and is
 * their help; it has the ranges, saga_encode_defaults the defaults.
 *
 * Precedence: an option that is given overrides the preset, and the preset
 * overrides the rule that follows from the capture (preset.h). The limits of
 * the level override all of them.
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
    const char *output; /* a file, or the folder of a sweep; required */

    /* How large and how long. One of lambda, size, bitrate and sweep determines
     * the size; 0: not given. */
    const char *preset; /* sets those of the following that are not given */
    double size;        /* bytes */
    double bitrate;     /* bits per second, over the capture's duration */
    bool sweep;         /* five files with different numbers of primitives */
    int primitives;     /* per segment; 0: derived from the size, or from
                         * the preset */
    int iterations;     /* per segment, all stages; 0: from the preset */
    double minutes;     /* instead of iterations; 0: use iterations */
    double lambda;      /* price of a bit (policy.h); 0: chosen to balance
                         * primitives and bits */
    const char *model;  /* "auto" or "paper" */
    int level;          /* 0 to 3; all plans obey its limits */
    const char *device; /* "auto", "cpu", "gpu" or a number of
                         * `saga devices` */
    int layers;         /* number of layers; a file may be cut after each */

    /* Which part of the capture's file to make. */
    int segment;        /* length in frames; 0: see preset.h */
    bool networks_only; /* write no segments, only the file that --networks
                         * reads */
    int only; /* the only segment to make; -1: all. Requires networks */
    const char *networks; /* file, or NULL */

    /* How to train. */
    double metres;    /* metres per unit of the capture; 0: from the capture */
    double box[6];    /* of --subject, as saga_capture.box; 0: by the masks */
    bool no_refine;   /* use poses and lenses as they are */
    bool no_exposure; /* do not store the exposures of the cameras */
    bool still, moving; /* override the measurement of motion */
    int seed;
    const char *ablate; /* words of ablation.h, or NULL */

    /* Output other than the file. */
    int every; /* seconds between checkpoints */
    bool resume;
    bool finish;     /* write what the checkpoint has, and end */
    const char *log; /* file, or NULL */
    bool json;       /* print the report as JSON */
    bool quiet;      /* show no progress */
    bool verbose;    /* print all tables of the report */
} saga_encode_options;

saga_encode_options saga_encode_defaults(void);

/* Returns whether the file has the paper's whole model. */
bool saga_encode_is_paper(const saga_encode_options *o);

/* Returns whether only a part of the capture's file is made. */
bool saga_encode_is_part(const saga_encode_options *o);

/* Returns whether the training can be cut short to a whole file without a
 * report, by --finish or on request (follow.h). */
bool saga_encode_can_finish(const saga_encode_options *o);

/* Reports contradictions between options, and looks up preset and ablation.
 * Returns the exit status. */
int saga_encode_check_options(const saga_encode_options *o,
                              const saga_preset **preset,
                              saga_ablation *ablation);

/* Returns the options that determine the file, as they were given; those not
 * given are 0, null or false. */
json_t *saga_encode_options_json(const saga_encode_options *o);

#endif
