/* SPDX-License-Identifier: MIT
 *
 * The options of a training. They are checked against the level and the
 * capture, and those that the user left open are planned from the capture
 * (preset.h) or derived from the others.
 */
#ifndef SAGA_OPTIONS_H
#define SAGA_OPTIONS_H

#include "ablation.h"
#include "capture.h"
#include "compute.h"
#include "error.h"
#include "isa.h"
#include "splat.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum saga_train_motion {
    SAGA_TRAIN_MEASURE, /* decided by the rule of motion.h */
    SAGA_TRAIN_MOVING,
    SAGA_TRAIN_STILL /* for experiments: the model has no temporal
                      * tools */
} saga_train_motion;

enum { SAGA_TRAIN_MOST_TEACHERS = 8 };

/* The progress of a training, defined in train.h. */
typedef struct saga_train_progress saga_train_progress;

/* Called after every iteration. The training stops there if it returns
 * false. */
typedef bool saga_train_progress_fn(void *user, const saga_train_progress *p);

typedef struct saga_train_options {
    int n_segments;            /* segments of the file, >= 1 */
    int first;                 /* the segment that is trained first, whose
                                * training makes the networks */
    const char *networks;      /* NULL, or the path of a file that
                                * saga_train_save_networks wrote; then segment
                                * `only` alone is trained, with the networks
                                * and with `first` from that file */
    int only;                  /* the segment to train where networks is
                                * set */
    uint32_t n_primitives;     /* primitives of a segment, 1 to the level's
                                * limit */
    bool free_count;           /* n_primitives is a guess, and the warm-up
                                * ends with the number that suits
                                * lambda > 0 */
    uint32_t n_coarse, n_fine; /* most anchors of each tier; 0: derived from
                                * n_primitives */
    int n_iterations;          /* iterations for all stages of a segment, >=
                                * 2 */
    int n_warm, n_render;      /* iterations of the warm-up and of the
                                * rendering; 0, 0: by SAGA_WARM_PART */
    double minutes;            /* time for all segments; > 0: n_iterations is
                                * what this machine does in a segment's share
                                * of it, which a short trial measures when
                                * training begins; a checkpoint keeps it */
    const char *above; /* NULL, or the path of a checkpoint of a training
                        * of one segment with more primitives, whose
                        * warm-up has ended: this one begins with those
                        * that are worth most. Its warm-up is as long,
                        * and its rendering stage has the part
                        * `shorter` of the iterations */
    double shorter;    /* 0..1 */
    saga_gpu *gpu;     /* the device that computes, or NULL: the processor; must
                        * outlive the training */
    const saga_splat_params *given; /* NULL, or n_primitives primitives of a
                                     * still, in the capture's units, that
                                     * replace the warm-up's; then lambda > 0 */
    size_t n_bytes;   /* size of the whole file, met within 5 %; > 0:
                       * lambda is 0, and training adjusts the step
                       * while it renders; 0: no size was asked
                       * for */
    double lambda;    /* bits per training pixel against distortion
                       * (policy.h); 0: derived from the warm-up's
                       * error and n_primitives */
    int level;        /* 0..3; a scene that needs more than the level
                       * allows is refused */
    int n_teachers;   /* 0..SAGA_TRAIN_MOST_TEACHERS teachers. They
                       * are trained before each warm-up, for half as
                       * many iterations; the warm-up learns from
                       * their mean picture between cameras that are
                       * far apart (rig/novel.h). No teachers are
                       * trained if no cameras are far apart */
    int n_layers;     /* layers of each segment, 1..SAGA_MAX_LAYERS;
                       * each layer has twice the primitives of the
                       * previous one, and the first those that give
                       * most light. With several layers there is no
                       * memory bank, and all segments must be
                       * trained by one process */
    bool paper;       /* the paper's whole model, whatever its parts
                       * cost: shared anchors, interpolation, Fuse,
                       * residual hash and memory bank; not given:
                       * what pays on our scenes */
    bool no_exposure; /* the file has no exposures of the cameras;
                       * training evens them out all the same */
    uint64_t seed;
    saga_train_motion motion;
    const char *ablate;        /* a list in the words of ablation.h, or
                                * NULL */
    const char *checkpoint;    /* path of the checkpoint, or NULL: none */
    double checkpoint_seconds; /* seconds between two checkpoints, >= 0 */
    saga_train_progress_fn *progress; /* or NULL */
    void *progress_user;
    saga_isa isa; /* of the checkpoint that saga_train_adopt has read */
} saga_train_options;

/* The part of a segment's iterations that the warm-up has; the rendering stage
 * has the rest, and its iterations take longer. */
#define SAGA_WARM_PART 0.6

/* Returns the defaults: one segment, 5,000 primitives, 6,000 iterations, level
 * 2, and a checkpoint every 5 minutes if it has a path. */
saga_train_options saga_train_defaults(void);

/* Checks the options against the level and the capture of a segment. Returns
 * false with *error set if they do not fit. */
bool saga_options_check(const saga_train_options *o, const saga_capture *c,
                        saga_error *error);

/* Sets *a to what o->ablate says. Returns false with *error set if a word is
 * unknown or exceeds the level. */
bool saga_options_ablation(saga_ablation *a, const saga_train_options *o,
                           saga_error *error);

/* Sets the numbers of anchors and the split of iterations where they are 0. */
void saga_options_derive(saga_train_options *o);

#endif
