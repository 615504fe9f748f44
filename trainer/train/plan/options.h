/* SPDX-License-Identifier: MIT
 *
 * A training is asked for with these options. They are checked against the
 * level and the capture, and those that nobody gave are derived from the others
 * or, before that, planned (preset.h).
 */
#ifndef SAGA_OPTIONS_H
#define SAGA_OPTIONS_H

#include "ablation.h"
#include "capture.h"
#include "error.h"
#include "splat.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

typedef enum saga_train_motion {
    SAGA_TRAIN_MEASURE,          /* the rule of motion.h */
    SAGA_TRAIN_MOVING,
    SAGA_TRAIN_STILL             /* the ablation */
} saga_train_motion;

enum { SAGA_TRAIN_MOST_TEACHERS = 8 };

/* Where a training is (train.h). */
typedef struct saga_train_progress saga_train_progress;

/* It is called after every iteration. Return false to stop there. */
typedef bool saga_train_progress_fn(void *user, const saga_train_progress *p);

typedef struct saga_train_options {
    int n_segments;              /* of the file, >= 1 */
    int first;                   /* the one that is trained first, and makes
                                  * the networks */
    const char *networks;        /* NULL, or a file of
                                  * saga_train_save_networks: `first` is what
                                  * it says, and of the others */
    int only;                    /* this one is trained, and no more */
    uint32_t n_primitives;       /* of a segment, 1..the level's */
    bool free_count;             /* n_primitives are a guess: the warm-up ends
                                  * with the number that suits lambda > 0 */
    uint32_t n_coarse, n_fine;   /* budgets of anchors; 0: by n_primitives */
    int n_iterations;            /* of all stages of a segment, >= 2; and its */
    int n_warm, n_render;        /* split, both or none given */
    double minutes;              /* of all segments; > 0: n_iterations is what
                                  * this machine does in a segment's part of
                                  * them, by a trial when training begins; a
                                  * checkpoint keeps it */
    const saga_splat_params *given; /* n_primitives in the capture's
                                  * units, in place of the warm-up's, of a
                                  * still; NULL: none. With them lambda > 0 */
    size_t n_bytes;              /* > 0: of the whole file, within 5 %; lambda
                                  * is 0 then, and changes while it is
                                  * rendered */
    double lambda;               /* bits per training pixel against
                                  * distortion (policy.h); 0: what balances
                                  * the warm-up's error and n_primitives */
    int level;                   /* 0..3, obeyed */
    int n_teachers;              /* 0..SAGA_TRAIN_MOST_TEACHERS warm-ups of half
                                  * its length before each, whose mean shows
                                  * it views between cameras that are far apart
                                  * (rig/novel.h); none where none are */
    int n_layers;                /* of each segment, 1..SAGA_MAX_LAYERS; each
                                  * has twice the primitives of the one before,
                                  * the first those of most light; there is no
                                  * memory bank then, and all segments are
                                  * trained in one place */
    uint64_t seed;
    saga_train_motion motion;
    const char *ablate;          /* ablation.h; NULL: nothing */
    const char *checkpoint;      /* file; NULL: none */
    double checkpoint_seconds;   /* between two of them, >= 0 */
    saga_train_progress_fn *progress; /* or NULL */
    void *progress_user;
} saga_train_options;

/* The warm-up has this part of the iterations. The rendering begins where it
 * ends, and its iterations cost more. */
#define SAGA_WARM_PART 0.6

/* The defaults are one segment, 5,000 primitives, 6,000 iterations, level 2, a
 * checkpoint every 5 minutes where one is wanted. */
saga_train_options saga_train_defaults(void);

/* Checks the options for the capture of a segment. */
bool saga_options_check(const saga_train_options *o, const saga_capture *c,
                        saga_error *error);

/* Reads what o->ablate says, within the level. */
bool saga_options_ablation(saga_ablation *a, const saga_train_options *o,
                           saga_error *error);

/* Sets the anchors and the split of iterations that nobody gave. */
void saga_options_derive(saga_train_options *o);

#endif
