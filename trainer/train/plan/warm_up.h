/* SPDX-License-Identifier: MIT
 *
 * Decisions about the warm-up of a segment: whether it may move, whether
 * teachers are trained before it, for how long, and how many primitives it has
 * if the user left that open.
 */
#ifndef SAGA_WARM_UP_H
#define SAGA_WARM_UP_H

#include "ablation.h"
#include "flat.h"
#include "options.h"
#include "pictures.h"
#include "preset.h"

/* A teacher has this part of the warm-up's iterations. With all of them it
 * takes twice the time and teaches no better (docs/lab/teachers.md). */
#define SAGA_LESSON_PART 0.5

/* On top of a base, a warm-up begins with this part of its primitives. Most of
 * the others, placed at random, would repeat the base; they are added later,
 * where the error is large. */
#define SAGA_START_ON_BASE 0.1

/* Returns the temporal tools with which a training warms up, or 0 for what
 * cannot move: a capture of one frame, or one that was said to be still. For
 * others, the end of the warm-up decides whether the scene keeps them. */
uint32_t saga_plan_time_tools(const saga_train_options *o,
                              const saga_capture *capture);

/* Returns the number of teachers that a preset has for a capture. The pictures
 * need not be loaded. */
int saga_plan_teachers(const saga_preset *preset, const saga_capture *capture);

/* Tells whether a segment may have the teachers in the options. Whether cameras
 * are far apart is decided later (rig/novel.h). */
bool saga_plan_may_teach(const saga_train_options *o, const saga_ablation *a,
                         const saga_pictures *segment);

/* Returns the iterations of a teacher for a warm-up of n_warm iterations. */
int saga_plan_teacher_length(int n_warm);

/* Tells whether teachers also teach while rendering, as in a still. The model
 * of a moving scene is better than its teachers by then: with three of their
 * pictures in ten, views between the cameras lose 0.7 dB
 * (docs/lab/teachers.md). */
bool saga_plan_teaches_rendering(const saga_capture *capture);

/* Returns the time of a training with teachers, over that without. */
double saga_plan_time_with(int n_teachers, const saga_capture *capture);

/* An iteration of the rendering stage takes the time of this many of the
 * warm-up, on the mean of a warm-up. */
#define SAGA_RENDER_COST 2.5

/* Returns the iterations, those of teachers not counted, of a training that
 * takes some seconds, if an iteration of the warm-up takes `warm` seconds. */
double saga_plan_timed(double seconds, double warm, int n_teachers,
                       const saga_capture *capture);

/* Returns the number of primitives that suits o->lambda, if the number is free
 * and is decided before the next iteration of the warm-up; otherwise 0. mse is
 * the mean squared error of its recent pictures. */
uint32_t saga_plan_count(const saga_train_options *o, const saga_flat *warm,
                         double mse, const saga_pictures *pictures);

#endif
