/* SPDX-License-Identifier: MIT
 *
 * The inside of the training, which the files of this room share.
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

struct saga_train {
    const saga_capture *capture;
    saga_pictures pictures;      /* of the capture */
    double *tones;               /* (views + 1, 3) exposures, then the
                                  * background: those of the segment that is
                                  * trained first serve all */
    uint64_t digest;             /* of these, where there are checkpoints */
    saga_train_options o;        /* resolved: nothing left to derive */
    saga_ablation ablation;      /* what o.ablate says */
    double lambda;               /* the option, or by the rule from the end of
                                  * the warm-up on */
    saga_policy policy;          /* from the end of the warm-up on */
    double room;                 /* of the networks' formats (pack.h) */
    saga_train_base base;        /* from the end of the first warm-up on */
    saga_backdrop backdrop;      /* the base as decoded; empty until it is */
    int turn;                    /* how many trainings are finished: where there
                                  * is a base the networks', the base, and then
                                  * all segments; else all segments */
    int n_views;                 /* of every segment */
    double n_pixels;             /* of the first segment's training pictures */
    uint64_t n_finished;         /* primitives of the finished segments */
    saga_train_stage stage;      /* of the segment in training */
    double recent_mse;           /* of the stage's pictures, for progress; 0:
                                  * none yet */
    saga_flat_options flat_options; /* of the warm-up; a teacher's differ */
    saga_novel novel;            /* the segment's teachers there are by now */
    int n_teachers;              /* that there will be: as asked for, or 0 */
    saga_flat *flat;             /* the warm-up, or a teacher until there are
                                  * n_teachers */

    /* From the rendering on. */
    bool fitting, dynamic;
    uint32_t tools;              /* of the picture, SAGA_TOOL_* */
    saga_train_tool tool[SAGA_TRAIN_N_TOOLS]; /* why */
    double explained, changing;
    saga_scene scene;
    saga_splat_params target;    /* (prim) in rank order, our arrays */
    saga_fit *fit;

    saga_scene decoded;          /* as the file has it, in float */
    saga_twin decoded_twin;

    saga_packed file;            /* of the finished segments */
    uint8_t *bytes;              /* the same, once its segment is finished */
    size_t nbytes;
    saga_train_report report;

    double saved;                /* seconds of the clock */
    saga_error complaint;
    bool complained;
};

/* turn.c */
/* Returns the segment of a turn, where `first` has the first and, with a base,
 * turn 1 is that. */
int saga_train_segment_at(int first, int turn, bool has_base);
int saga_train_n_turns(const saga_train *t, bool has_base);
/* Tells whether the base is in training. */
bool saga_train_in_base(const saga_train *t);

/* progress.c */
/* Sets the iterations by the minutes that were asked for, by a trial. */
bool saga_train_spend_minutes(saga_train *t, saga_error *error);
/* These return the iterations that a stage has, and the current one's number in
 * its stage. */
int saga_train_stage_iterations(const saga_train *t, saga_train_stage stage);
int saga_train_stage_iteration(const saga_train *t);
/* Calls the progress function; false: it wants to stop. */
bool saga_train_tell(const saga_train *t);

/* begin.c */
/* Makes a training whose options are checked and whose pictures are there. */
saga_train *saga_train_make(const saga_capture *capture,
                            const saga_train_options *options,
                            saga_error *error);
/* Checks t->o for t->capture, derives what it leaves open, and sets what
 * follows from it. */
bool saga_train_set_up(saga_train *t, saga_error *error);
/* Makes the pictures of a segment's capture. */
bool saga_train_look_at(saga_train *t, const saga_capture *capture,
                        saga_error *error);
/* Drops all that is of one segment. */
void saga_train_end_segment(saga_train *t);
/* The file has one rig: this says whether a segment's capture has its views. */
bool saga_train_same_views(const saga_train *t, const saga_capture *capture,
                           int segment, saga_error *error);
/* Evens out the pictures' tones, unless primitives are given, and keeps
 * them. */
bool saga_train_find_tones(saga_train *t, saga_error *error);
/* Gives the pictures t->tones. */
void saga_train_tone(saga_train *t);
/* Sets of the warm-up's options what is not the same for all segments. */
void saga_train_set_flat(saga_train *t);
/* Says how splats fall off: as the networks that are there want it. */
void saga_train_set_splats(saga_train *t);

/* begin_fit.c */
/* Sets lambda, where the rule has to, and what goes by it. */
void saga_train_settle_price(saga_train *t);
/* Builds the hierarchy and the fit; t->dynamic is decided. */
bool saga_train_begin_fit(saga_train *t, saga_error *error);

/* teach.c */
/* Finds out whether the segment has teachers, and places their cameras; its
 * pictures and the base are there. */
bool saga_train_place_teachers(saga_train *t, saga_error *error);
/* Tells whether t->flat is a teacher. */
bool saga_train_is_teaching(const saga_train *t);
/* Returns what all teachers take, of the time of a warm-up. */
double saga_train_teaching(const saga_train *t);
/* Return the iterations of warm-up and teachers, in all and so far. */
int saga_train_warm_iterations(const saga_train *t);
int saga_train_warm_iteration(const saga_train *t);
/* Makes t->flat: the next teacher, or the warm-up. */
bool saga_train_begin_warm(saga_train *t, saga_error *error);
/* Where a teacher has had its iterations, keeps it and begins the next set;
 * called before each iteration. */
bool saga_train_end_lesson(saga_train *t, saga_error *error);
/* Save and restore teachers and t->flat. */
void saga_train_save_warm(saga_train *t, saga_checkpoint *c);
bool saga_train_load_warm(saga_train *t, saga_checkpoint *c,
                          saga_error *error);

/* decide.c: the plan (plan/) is asked. */
/* Makes m from options, ablation, policy and tools. */
void saga_train_model(saga_model *m, const saga_train *t);
/* Decides, when the first warm-up ends, what moves, on tools, and on a base;
 * lambda and policy are there. Later turns have the tools of the first. */
bool saga_train_decide(saga_train *t, saga_error *error);
/* Tells whether the options leave a base open. */
bool saga_train_may_have_base(const saga_train *t);
/* Where a size was asked for, brings the file nearer to it, before an iteration
 * of the rendering. */
bool saga_train_steer(saga_train *t, saga_error *error);
/* Returns the primitives of what is in training: where a size was asked for, as
 * many as fill what the finished segments left of it. */
uint32_t saga_train_share(const saga_train *t);

/* finish.c */
/* Packs at level 3 and compares with the caps of the level asked for. */
bool saga_train_check_level(saga_train *t, saga_error *error);
/* Sets the report's sizes to what the file would take if training ended
 * here. */
bool saga_train_measure_size(saga_train *t, saga_error *error);
/* Polishes what is rendered, if it is going to be in the file. */
bool saga_train_polish(saga_train *t, saga_error *error);
bool saga_train_pack(saga_train *t, saga_error *error);
/* Does the same without looking at pictures. */
bool saga_train_pack_blind(saga_train *t, saga_error *error);

/* backdrop.c */
/* Returns the number of reals in the block of a base of n primitives. */
size_t saga_train_base_reals(uint32_t n, int n_views);
/* Makes room for n primitives, whose arrays lie behind each other in the block:
 * those that all views share, then the colours of each view. */
bool saga_train_alloc_base(saga_backdrop *b, uint32_t n, int n_views,
                           saga_error *error);
void saga_train_free_base(saga_backdrop *b);
/* Makes t->backdrop of the decoded base and its twin. */
bool saga_train_keep_base(saga_train *t, saga_error *error);
/* Has the pictures drawn with the base, once there is one. */
void saga_train_show_base(saga_train *t);

/* save.c */
bool saga_train_save(saga_train *t, saga_error *error);
bool saga_train_load(saga_train *t, saga_error *error);
/* Continues after the first segment, from o.networks. */
bool saga_train_load_networks(saga_train *t, saga_error *error);

#endif
