/* SPDX-License-Identifier: MIT
 *
 * The warm-up of a segment: whether teachers come before it and how long they
 * learn, and how many primitives it has where nobody said.
 */
#ifndef SAGA_WARM_UP_H
#define SAGA_WARM_UP_H

#include "ablation.h"
#include "flat.h"
#include "options.h"
#include "pictures.h"
#include "preset.h"

/* A teacher has this part of the warm-up's iterations; with all of them it
 * costs twice the time, and teaches no better (docs/lab/teachers.md). */
#define SAGA_LESSON_PART 0.5

/* On a base a warm-up begins with this part of its primitives: most of those
 * drawn at random would be the base's once more, and the errors say where the
 * others are needed. */
#define SAGA_START_ON_BASE 0.1

/* Returns the teachers that a preset asks for a capture, whole. */
int saga_plan_teachers(const saga_preset *preset, const saga_capture *capture);

/* Tells whether a segment may have the teachers that were asked for; cameras
 * that are far apart are still to be found (novel.h). */
bool saga_plan_may_teach(const saga_train_options *o, const saga_ablation *a,
                         const saga_pictures *segment);

/* Returns the iterations of a teacher, before a warm-up of n_warm. */
int saga_plan_lesson(int n_warm);

/* Returns what a training takes with teachers, of its time without. */
double saga_plan_time_with(int n_teachers);

/* Returns the primitives that suit o->lambda, where a free count is settled at
 * the warm-up's coming iteration; 0: it is not. mse: its pictures' of late. */
uint32_t saga_plan_count(const saga_train_options *o, const saga_flat *warm,
                         double mse, const saga_pictures *pictures);

#endif
