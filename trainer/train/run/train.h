/* SPDX-License-Identifier: MIT
 *
 * Training makes a file from a capture. One state machine runs the stages
 * below; between any two iterations it can be saved, and a restored one gives
 * the same file, bit for bit.
 *
 *     warm-up      a flat set of primitives (warm/flat.h)
 *     rendering    rate and distortion against the pictures (fit.h)
 *     packing      quantised networks, closed loop, bytes (pack.h)
 *
 * A long capture is trained in segments, one after the other, and only the
 * pictures of one are needed at a time. The first to be trained makes the
 * networks. They go into the file once, and the others find primitives and
 * features for them as they are. What stays of a finished segment is its bytes.
 *
 * Where at least a quarter of that first segment's warm-up stands still, these
 * primitives are sent once for the file, as its base: of the first training
 * only the networks are kept, the base is trained with them on a picture of
 * every view that shows what stands still in the whole capture (still.h), and
 * then each segment, the first one too, on top of it.
 *
 * The result does not depend on the number of threads. A capture must outlive
 * the training of its segment.
 */
#ifndef SAGA_TRAIN_H
#define SAGA_TRAIN_H

#include "base_choice.h"
#include "capture.h"
#include "encode.h"
#include "options.h"
#include "quality.h"
#include "quantise.h"
#include "saga.h"
#include "tool_choice.h"

typedef enum saga_train_stage {
    SAGA_TRAIN_WARM, SAGA_TRAIN_RENDER, SAGA_TRAIN_PACK,
    SAGA_TRAIN_N_STAGES
} saga_train_stage;

/* This stands where a segment's number would, for the base. */
enum { SAGA_TRAIN_BASE = 1 << 24 };

struct saga_train_progress {
    saga_train_stage stage;
    const char *name;            /* of the stage */
    int segment;                 /* of the file, in order of time, or
                                  * SAGA_TRAIN_BASE */
    int iteration, n_iterations; /* of the stage; it begins at 0 */
    int all;                     /* iterations of all stages and segments so
                                  * far */
    double psnr;                 /* of recent training pictures; 0: none yet */
    double bits;                 /* the residuals would take; 0 before the
                                  * rendering */
    double done;                 /* 0..1 of all segments' work, an estimate */
};

/* The sources of one kind of residual are worth so much, in bytes. */
typedef struct saga_train_kind {
    uint32_t sources;            /* SAGA_SOURCE_* that were kept */
    double constants;            /* residuals without sources, */
    double networks;             /* with all that were trained, */
    double forgetful;            /* with these but for the bank, */
    double chosen;               /* with those that were kept */
    double weights;              /* of the kept network, about */
} saga_train_kind;

/* The choice among sources rests on these estimates on the trained model, of
 * the segment that made the networks. */
typedef struct saga_train_entropy {
    saga_train_kind kind[SAGA_N_KINDS];
    double hyper_weights;        /* bytes of the hyperprior, about; 0: off */
    double bank_weights;         /* of the bank's networks, about, kept or
                                  * not */
    double bank_net;             /* what the bank adds to all of this, its
                                  * networks counted: kept if below 0; 0: no
                                  * kind gains from it */
    double estimate[SAGA_N_SYMS]; /* code lengths of the residuals, bits, by
                                  * SAGA_SYM_*; 0: none of them */
} saga_train_entropy;

/* The sums over all segments that are finished. */
typedef struct saga_train_report {
    saga_encode_sizes sizes;
    saga_quantise_report quantise;
    saga_counts n;               /* coarse, fine, primitives; most of any */
    saga_info info;              /* of the file, as its decoder sees it */
    double lambda;               /* as asked for, or by the rule */
    saga_train_base base;
    bool dynamic;                /* temporal tools are on */
    saga_train_tool tool[SAGA_TRAIN_N_TOOLS];
    double explained;            /* by the rule above; NaN: not measured */
    double changing;             /* part of the pixels the rule looked at */
    saga_train_entropy entropy;
    uint32_t n_parameters;       /* weights and biases of all networks */
    double weight_bits;          /* of all weights of the networks with inputs,
                                  * but the entropy model's, and of scales by
                                  * row or column */
    saga_quality warm;     /* the flat warm-up */
    saga_quality model;    /* the float model, coarse features and
                                  * networks rounded */
    saga_quality coded;    /* decoded symbols and weights, in float */
} saga_train_report;

typedef struct saga_train saga_train;

/* These return the iterations of all stages together, as asked for or tried, of
 * a segment; and those that are done, of all segments. */
int saga_train_n_iterations(const saga_train *train);
int saga_train_iteration(const saga_train *train);

/* Begins a training; the capture is that of segment options->first, or with
 * networks of options->only. NULL, with the reason in *error: an option and the
 * remedy. */
saga_train *saga_train_new(const saga_capture *capture,
                           const saga_train_options *options,
                           saga_error *error);

/* Returns the segment that a checkpoint's training was in, or SAGA_TRAIN_BASE;
 * negative, with the reason in *error, where it cannot be read. */
int saga_train_stopped_in(const char *checkpoint, saga_error *error);

/* Sets n_primitives and n_iterations, where they are 0, as a checkpoint or a
 * file of networks has them. */
bool saga_train_adopt(saga_train_options *options, const char *checkpoint,
                      saga_error *error);

/* Continues from options->checkpoint; options as they were, but for first,
 * progress, checkpoint and its time; the capture of the segment it was in. */
saga_train *saga_train_resume(const saga_capture *capture,
                              const saga_train_options *options,
                              saga_error *error);

void saga_train_free(saga_train *train);

/* Packs what a checkpoint's training has by now, without its capture: the
 * finished segments and the one in training as it is. *bytes are a file's, to
 * be freed; where the last iteration is done they are what the training packs,
 * but of a segment that only makes the networks for a base: it is shown alone.
 * Fails, and says so, where there is nothing to pack yet: in the base, and in a
 * warm-up before any segment is finished. */
bool saga_train_peek(uint8_t **bytes, size_t *nbytes, const char *checkpoint,
                     saga_error *error);

/* Works until the segment is there, or the progress function stops it. Writes
 * the checkpoint every checkpoint_seconds, at the end of a stage and when
 * stopped; one that cannot be written does not end the training:
 * saga_train_complaint. */
saga_outcome saga_train_run(saga_train *train, saga_error *error);

/* Returns the last failure to write a checkpoint since the last call; NULL:
 * none. */
const char *saga_train_complaint(saga_train *train);

/* Returns the segment in training, or just finished; may be SAGA_TRAIN_BASE. */
int saga_train_segment(const saga_train *train);

/* Returns what the pictures of the segment's views were multiplied by before
 * training, (views, 3); all 1 where cameras agree. */
const double *saga_train_exposure(const saga_train *train);

/* Returns the segment that comes after it, -1 where it is the last; may be
 * SAGA_TRAIN_BASE. */
int saga_train_upcoming(const saga_train *train);

/* Goes on with the upcoming segment, whose capture it is (of the base:
 * still.h), after SAGA_DONE; the last one's is not needed any more. Where it
 * fails only saga_train_free is left to be called. */
bool saga_train_next(saga_train *train, const saga_capture *capture,
                     saga_error *error);

/* Writes what other trainings need of the first segment, and of the base, after
 * the SAGA_DONE of that which comes last: each may train one of the others, at
 * the same time and elsewhere, and gives the bytes that this one would. */
bool saga_train_save_networks(saga_train *train, const char *path,
                              saga_error *error);

/* Returns the segment that made the networks. Where there is no base, it is
 * among the finished ones of every training. */
int saga_train_first(const saga_train *train);

/* These may be called after SAGA_DONE: the file of all finished segments, NULL
 * where there is none yet. The bytes belong to train, until its next segment.
 */
const saga_train_report *saga_train_report_of(const saga_train *train);
const uint8_t *saga_train_bytes(const saga_train *train, size_t *n);

/* Draws, after SAGA_DONE, the picture (3, H, W) of the decoded symbols and
 * weights of the finished segment in float, which the integer decoder's can be
 * compared with. Fails where memory is short. */
bool saga_train_draw(saga_train *train, float *image, int view, int frame,
                     saga_error *error);

const char *saga_train_stage_name(saga_train_stage stage);

#endif
