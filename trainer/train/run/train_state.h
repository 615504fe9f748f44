/* SPDX-License-Identifier: MIT
 *
 * The inside of the training, shared by the files of this room.
 */
#ifndef SAGA_TRAIN_STATE_H
#define SAGA_TRAIN_STATE_H

#include "ablation.h"
#include "camera.h"
#include "error.h"
#include "fit.h"
#include "flat.h"
#include "hierarchy.h"
#include "novel.h"
#include "options.h"
#include "pack.h"
#include "pictures.h"
#include "policy.h"
#include "scene.h"
#include "train.h"

#include <stdio.h>

/* The warm-up of a segment and its teachers (teach.c, begin.c). */
typedef struct saga_train_warm {
    saga_flat_options options; /* a teacher's differ */
    saga_novel novel;          /* the segment's teachers so far */
    int n_teachers;            /* that the segment gets: the option, or 0 */
    saga_flat *flat;           /* the warm-up or, until there are n_teachers,
                                * the next teacher */
} saga_train_warm;

/* The rendering stage of a segment (decide.c, begin_fit.c). */
typedef struct saga_train_render {
    bool fitting, dynamic;
    uint32_t tools; /* SAGA_TOOL_* bits of the picture */
    saga_train_tool tool[SAGA_TRAIN_N_TOOLS]; /* the verdicts on them */
    double explained, changing;
    saga_scene scene;
    saga_splat_params target; /* (prim) in order of ranks, with arrays of its
                               * own */
    saga_fit *fit;
} saga_train_render;

/* The packed segment, and the file (finish.c). */
typedef struct saga_train_packed {
    saga_scene scene; /* the segment as a decoder has it, in float */
    saga_twin twin;
    saga_packed file; /* the file with the finished segments */
    uint8_t *bytes;   /* bytes of that file, when the segment is
                       * finished */
    size_t nbytes;
} saga_train_packed;

struct saga_train {
    const saga_capture *capture;
    saga_pictures pictures; /* made from capture */
    double *exposures;      /* (views + 1, 3) exposures, and in the last
                             * row the background; all segments use those
                             * of the first */
    uint64_t digest;        /* digest of the pictures, if there are
                             * checkpoints */
    saga_train_options o;   /* options after all have been derived */
    saga_ablation ablation; /* what o.ablate says */
    saga_policy policy;     /* from the end of the warm-up on; only lambda
                             * before */
    double room;            /* room in the networks' formats (pack.h) */
    int turn;               /* number of finished trainings. With a base
                             * they are the one for the networks, the base,
                             * and all segments; without one, all
                             * segments */
    int n_views;            /* views of every segment */
    double n_pixels;        /* training pixels of the first segment */
    uint64_t n_finished;    /* primitives of the finished segments */
    saga_train_stage stage; /* stage of the segment in training */
    double recent_mse;      /* mean over recent pictures of the stage, for
                             * progress and price; 0: none yet */

    /* Each stage sets its part. */
    saga_train_warm warm;
    saga_train_render render;
    saga_train_packed packed;
    saga_train_base base;   /* set at the end of the first warm-up */
    saga_backdrop backdrop; /* the decoded base; empty until then */

    saga_train_report report;
    double saved; /* time of the last checkpoint, in seconds of
                   * saga_clock_seconds */
    bool kept;    /* a checkpoint was written since the beginning, or could not
                   * be */
    saga_error complaint;
    bool complained;
};

/* turn.c */
/* Returns the segment of a turn, or SAGA_TRAIN_BASE. Turn 0 trains segment
 * `first`; with a base, turn 1 trains the base. */
int saga_train_segment_at(int first, int turn, bool has_base);
int saga_train_n_turns(const saga_train *t, bool has_base);
/* Tells whether the base is in training. */
bool saga_train_in_base(const saga_train *t);

/* progress.c */
/* Sets the number of iterations from the minutes in the options, by a trial. */
bool saga_train_spend_minutes(saga_train *t, saga_error *error);
/* Return the number of iterations of a stage, and the index of the current one
 * in its stage. */
int saga_train_stage_iterations(const saga_train *t, saga_train_stage stage);
int saga_train_stage_iteration(const saga_train *t);
/* Returns the part of all segments' work that is done, 0..1, an estimate. */
double saga_train_part_done(const saga_train *t);
/* Calls the progress function. Returns false if it stops the training. */
bool saga_train_notify(const saga_train *t);

/* begin.c */
/* Makes a training after checking its options, and takes the pictures of the
 * capture. Returns NULL with *error set on failure. */
saga_train *saga_train_make(const saga_capture *capture,
                            const saga_train_options *options,
                            saga_error *error);
/* Checks t->o for t->capture, derives the options left open, and sets the
 * members that follow from them. */
bool saga_train_set_up(saga_train *t, saga_error *error);
/* Makes the pictures of a segment's capture. */
bool saga_train_look_at(saga_train *t, const saga_capture *capture,
                        saga_error *error);
/* Frees everything that belongs to one segment. */
void saga_train_end_segment(saga_train *t);
/* Checks that a segment's capture has as many views as the first one's, since a
 * file has one rig. Returns false with *error set if not. */
bool saga_train_same_views(const saga_train *t, const saga_capture *capture,
                           int segment, saga_error *error);
/* Evens out the exposures of the pictures, unless primitives are given, and
 * keeps the result in t->exposures. */
bool saga_train_find_exposures(saga_train *t, saga_error *error);
/* Sets the exposures and background of the pictures from t->exposures. */
void saga_train_set_exposures(saga_train *t);
/* Sets the options of the warm-up that differ between segments. */
void saga_train_set_flat(saga_train *t);
/* Sets the kind of splat for the pictures: that of the networks, if they
 * exist. */
void saga_train_set_splats(saga_train *t);

/* begin_fit.c */
/* Sets lambda, if the rule decides it, and the policy. */
void saga_train_settle_price(saga_train *t);
/* Builds the hierarchy and the fit, when t->render.dynamic is decided. */
bool saga_train_begin_fit(saga_train *t, saga_error *error);

/* teach.c */
/* Decides whether the segment has teachers, and places their cameras. Its
 * pictures and the base must be set. */
bool saga_train_place_teachers(saga_train *t, saga_error *error);
/* Tells whether t->warm.flat is a teacher. */
bool saga_train_is_teaching(const saga_train *t);
/* Return the iterations of the warm-up and all teachers: their total, and the
 * number done. */
int saga_train_warm_iterations(const saga_train *t);
int saga_train_warm_iteration(const saga_train *t);
/* Returns the work of teachers and warm-up so far, or all of it, in iterations
 * that draw whole pictures. */
double saga_train_warm_work(const saga_train *t, bool all);
/* Makes t->warm.flat, which is the next teacher or the warm-up. */
bool saga_train_begin_warm(saga_train *t, saga_error *error);
/* Is called before each iteration. If a teacher is finished, keeps it and
 * begins the next teacher or the warm-up. */
bool saga_train_end_teacher(saga_train *t, saga_error *error);
/* Is called before the rendering stage, in which pictures are from the teachers
 * only if saga_plan_teaches_rendering. */
void saga_train_end_teaching(saga_train *t);
/* Save and restore the teachers and t->warm.flat. */
void saga_train_save_warm(saga_train *t, saga_checkpoint *c);
bool saga_train_load_warm(saga_train *t, saga_checkpoint *c, saga_error *error);

/* decide.c: passes the decisions of plan/ on to the training. */
/* Makes *m from options, ablation, policy and tools. */
void saga_train_model(saga_model *m, const saga_train *t);
/* Returns the largest number of primitives, at most n, that the level has room
 * for with the model that is known by now: that of the networks, or that of
 * the tools that were chosen. */
uint32_t saga_train_room(const saga_train *t, uint32_t n);
/* Decides, at the end of the first warm-up, whether anything moves, on tools,
 * and on a base. Lambda and policy must be set. Later turns get the tools of
 * the first. */
bool saga_train_decide(saga_train *t, saga_error *error);
/* Tells whether a base is possible with these options. */
bool saga_train_may_have_base(const saga_train *t);
/* Is called before each iteration of the rendering stage; adjusts the step if a
 * size was asked for. */
bool saga_train_steer(saga_train *t, saga_error *error);
/* Returns the number of primitives for the present turn. If a size was asked
 * for, it is the number that fills what the finished segments left. */
uint32_t saga_train_share(const saga_train *t);

/* finish.c */
/* Sets the sizes in the report to those that the file would have if training
 * ended here. */
bool saga_train_measure_size(saga_train *t, saga_error *error);
/* Polishes the fit (fit_polish.h), unless it only makes the networks. */
bool saga_train_polish(saga_train *t, saga_error *error);
bool saga_train_pack(saga_train *t, saga_error *error);
/* Packs the scene too, but measures no pictures. */
bool saga_train_pack_blind(saga_train *t, saga_error *error);

/* backdrop.c */
/* Returns the number of reals in the block of a base with n primitives. */
size_t saga_train_base_reals(uint32_t n, int n_views);
/* Allocates n primitives. Their arrays are in one block: first those that all
 * views share, then the colours of each view. */
bool saga_train_alloc_base(saga_backdrop *b, uint32_t n, int n_views,
                           saga_error *error);
void saga_train_free_base(saga_backdrop *b);
/* Copies the decoded base and its colours into t->backdrop. */
bool saga_train_keep_base(saga_train *t, saga_error *error);
/* Draws the pictures from now on with the base behind them, if it exists. */
void saga_train_show_base(saga_train *t);

/* save.c */
bool saga_train_save(saga_train *t, saga_error *error);
bool saga_train_load(saga_train *t, saga_error *error);
/* Begins with primitives of the warm-up in the checkpoint o.above. */
bool saga_train_load_above(saga_train *t, saga_error *error);
/* Continues after the first segment, from the file o.networks. */
bool saga_train_load_networks(saga_train *t, saga_error *error);

#endif
