/* SPDX-License-Identifier: MIT
 *
 * Training makes a file from a capture. A state machine runs the stages below.
 * It can be saved between any two iterations, and a restored training gives the
 * same file, bit for bit.
 *
 *     warm-up      a flat set of primitives (warm/flat.h)
 *     rendering    rate and distortion against the pictures (fit.h)
 *     packing      quantised networks, closed loop, bytes (pack.h)
 *
 * A long capture is trained in segments, one after the other, and only the
 * pictures of one are in memory. The first segment to be trained makes the
 * networks, which the file holds once; the others find primitives and features
 * for these networks. Of a finished segment only its coded bytes are kept.
 *
 * If at least a quarter of the first segment's warm-up stands still, these
 * primitives are sent once for the file, as its base. Then only the networks
 * are kept of the first training. The base is trained next with these networks,
 * on one picture of every view that shows what stands still in the whole
 * capture (still.h), and then each segment, the first one again, on top of the
 * base.
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
    SAGA_TRAIN_WARM,
    SAGA_TRAIN_RENDER,
    SAGA_TRAIN_PACK,
    SAGA_TRAIN_N_STAGES
} saga_train_stage;

/* The number that stands for the base in place of a segment's. */
enum { SAGA_TRAIN_BASE = 1 << 24 };

struct saga_train_progress {
    saga_train_stage stage;
    const char *name;            /* name of the stage */
    int segment;                 /* number in order of time, or
                                  * SAGA_TRAIN_BASE */
    int iteration, n_iterations; /* number in the stage, from 0 */
    int all;                     /* iterations so far, of all stages and
                                  * segments */
    double psnr;                 /* PSNR in dB of recent training pictures; 0:
                                  * none yet */
    double bits;                 /* estimated bits of all residuals; 0 before
                                  * the rendering stage */
    double done;                 /* part of all segments' work, 0..1, an
                                  * estimate */
};

/* Bytes of one kind of residual with different sources. */
typedef struct saga_train_kind {
    uint32_t sources; /* SAGA_SOURCE_* bits of the sources that were
                       * kept */
    double constants; /* bytes of its residuals without sources */
    double networks;  /* bytes with all sources that were trained */
    double forgetful; /* bytes with these except the memory bank */
    double chosen;    /* bytes with the sources that were kept */
    double weights;   /* bytes of its entropy network with these,
                       * about */
} saga_train_kind;

/* The estimates by which sources were chosen, on the trained model of the
 * segment that made the networks. */
typedef struct saga_train_entropy {
    saga_train_kind kind[SAGA_N_KINDS];
    double hyper_weights; /* bytes of the hyperprior's network, about; 0:
                           * it is off */
    double bank_weights;  /* bytes of the bank's networks, about, whether
                           * it was kept or not */
    double bank_net;      /* bytes that the bank adds to the file,
                           * including its networks; it was kept if they
                           * are negative; 0: no kind gains from it */
    double estimate[SAGA_N_SYMS]; /* code length of the residuals in bits, by
                                   * SAGA_SYM_*; 0: there are none */
} saga_train_entropy;

/* Sums over all finished segments. */
typedef struct saga_train_report {
    saga_encode_sizes sizes;
    saga_quantise_report quantise;
    saga_counts n;  /* coarse anchors, fine anchors and primitives
                     * of the largest segment */
    saga_info info; /* the file's properties, from its decoder */
    double lambda;  /* the option, or by the rule (policy.h) */
    saga_train_base base;
    bool dynamic; /* the model has temporal tools */
    saga_train_tool tool[SAGA_TRAIN_N_TOOLS];
    double explained; /* as in motion.h; NaN: it was not measured */
    double changing;  /* as in motion.h */
    saga_train_entropy entropy;
    uint32_t n_left_out;   /* primitives of the warm-ups for which the
                            * level had no room */
    uint32_t n_parameters; /* number of weights and biases of all
                            * networks */
    double weight_bits;    /* bits of all weights of the networks that
                            * have inputs, except the entropy model's, and
                            * of scales by row or column */
    saga_quality warm;     /* quality of the warm-up */
    saga_quality model;    /* quality of the float model, with coarse features
                            * and networks rounded */
    saga_quality coded;    /* quality of the decoded symbols and weights,
                            * computed in float */
} saga_train_report;

typedef struct saga_train saga_train;

/* Return the iterations of all stages of a segment, as asked for or found by a
 * trial, and the iterations that are done, over all segments. */
int saga_train_n_iterations(const saga_train *train);
int saga_train_iteration(const saga_train *train);

/* Begins a training. The capture is that of segment options->first or, with
 * options->networks, of options->only. Returns NULL with *error set, to the
 * option that is wrong and a remedy. */
saga_train *saga_train_new(const saga_capture *capture,
                           const saga_train_options *options,
                           saga_error *error);

/* Returns the segment in which a checkpoint's training is, or SAGA_TRAIN_BASE.
 * Returns a negative number with *error set if the checkpoint cannot be
 * read. */
int saga_train_stopped_in(const char *checkpoint, saga_error *error);

/* Sets n_primitives and n_iterations, where they are 0, and isa to those of a
 * checkpoint or a file of networks. Returns false with *error set if it cannot
 * be read. */
bool saga_train_adopt(saga_train_options *options, const char *checkpoint,
                      saga_error *error);

/* Continues from options->checkpoint. The capture is that of the segment it was
 * in. The options must be those it was begun with, except first, progress, and
 * the path and interval of the checkpoint. Returns NULL with *error set on
 * failure. */
saga_train *saga_train_resume(const saga_capture *capture,
                              const saga_train_options *options,
                              saga_error *error);

void saga_train_free(saga_train *train);

/* Packs the present state of a checkpoint's training, without its capture: the
 * finished segments, and the one in training as it is now. Sets *bytes and
 * *nbytes to a file; the caller frees *bytes. After the last iteration they are
 * the bytes that the training itself packs. With a base there is one exception:
 * its first segment only makes the networks, and gives a file of its own. In a
 * warm-up the file has the finished segments or, if there are none, what the
 * warm-up has by now. Returns false with *error set while the base is trained,
 * from which alone no file can be made. */
bool saga_train_peek(uint8_t **bytes, size_t *nbytes, const char *checkpoint,
                     saga_error *error);

/* Runs until the segment is finished or the progress function stops it. It
 * writes the checkpoint every checkpoint_seconds, for the first time after a
 * tenth of the work at the latest, at the end of a stage, and when stopped. A
 * checkpoint that cannot be written does not end the training
 * (saga_train_complaint). */
saga_outcome saga_train_run(saga_train *train, saga_error *error);

/* Returns the last failure to write a checkpoint since the previous call, or
 * NULL. */
const char *saga_train_complaint(saga_train *train);

/* Returns the segment that is in training or just finished, or
 * SAGA_TRAIN_BASE. */
int saga_train_segment(const saga_train *train);

/* Returns the factors (views, 3) on the pictures of each view that even out the
 * exposures of cameras; all are 1 if they agree. */
const double *saga_train_exposure(const saga_train *train);

/* Returns the segment that is trained after this one, SAGA_TRAIN_BASE, or -1
 * after the last. */
int saga_train_upcoming(const saga_train *train);

/* Begins the upcoming segment, after SAGA_DONE. capture is that of the segment,
 * or of the base (still.h); the previous one is not needed any more. If it
 * returns false, only saga_train_free may be called. */
bool saga_train_next(saga_train *train, const saga_capture *capture,
                     saga_error *error);

/* Writes a file of what other trainings need of the first segment and of the
 * base. It is called after the SAGA_DONE of the base, or of the first segment
 * if there is no base. From this file others can train one of the remaining
 * segments each, on other machines at the same time, to the same bytes as
 * here. */
bool saga_train_save_networks(saga_train *train, const char *path,
                              saga_error *error);

/* Returns the segment that made the networks. Without a base, every training
 * that starts from the networks has it among its finished segments. */
int saga_train_first(const saga_train *train);

/* Return, after SAGA_DONE, the report and the file of all finished segments;
 * NULL if no segment is finished. Both are owned by the training and valid
 * until its next segment begins. */
const saga_train_report *saga_train_report_of(const saga_train *train);
const uint8_t *saga_train_bytes(const saga_train *train, size_t *n);

/* Draws a picture (3, H, W) of the finished segment from its decoded symbols
 * and weights, in float, to compare the integer decoder's with. It is called
 * after SAGA_DONE. Returns false with *error set if memory is short. */
bool saga_train_draw(saga_train *train, float *image, int view, int frame,
                     saga_error *error);

#endif
