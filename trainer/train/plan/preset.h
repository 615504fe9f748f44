/* SPDX-License-Identifier: MIT
 *
 * Plans from the capture what a user leaves open of a training: how many
 * primitives, how many iterations. The reasons are told in words.
 */
#ifndef SAGA_PRESET_H
#define SAGA_PRESET_H

#include "options.h"

/* A preset says how much work is put into a file; docs/presets.md has them in a
 * table. What is given goes before it. */
typedef struct saga_preset {
    const char *name;
    double primitives;           /* times those of the rule; more of them show
                                  * finer things, and take bytes and time */
    int iterations;              /* of all stages, */
    int visits;                  /* but that many for each picture at least */
    double still_minutes;        /* of a still no more than that, by
                                  * saga_plan_minutes; 0: no limit, */
    int still_visits;            /* but that many for each of its pictures */
    int teachers;                /* where cameras are far apart (train.h); they
                                  * take some 50 % more time */
    const char *plus;            /* what it has that the one before has not */
    const char *better;          /* which is worth a try where it is not good
                                  * enough; NULL: none */
} saga_preset;

/* These return a preset by number, the quickest first (NULL past the last), and
 * by name (NULL: no such). */
const saga_preset *saga_preset_at(int number);
const saga_preset *saga_preset_called(const char *name);

/* One sentence each, without a full stop; empty: nothing was left open. */
typedef struct saga_plan_reasons {
    char primitives[160], iterations[160];
} saga_plan_reasons;

/* Most frames of a segment. */
enum { SAGA_PLAN_MOST_FRAMES = 65535 };

/* Returns how many segments a capture is trained in, of whose frames nothing
 * but number, rate and how many fit is looked at. They have about this number
 * of frames; 0: of ten seconds, or 24 frames where these are longer, if they
 * fit, of a second at least, and of a camera that moves, all of them. */
int saga_plan_segments(const saga_capture *capture, int frames);

/* Returns N where the pictures of a still should be 1/N of their size, of a
 * capture that was looked at: 1 where whole ones are visited still_visits times
 * within still_minutes, else the least with which smaller ones are, in 500
 * iterations at least; they keep 100,000 pixels each. Primitives follow the
 * pixels. Where o has iterations or minutes, which somebody gave, it is 1. */
int saga_plan_scale(const saga_train_options *o, const saga_capture *looked_at,
                    const saga_preset *preset);

/* Returns the primitives that a segment of this length, seconds, wants of whose
 * pixels at one moment, of all views together, a part 0..1 changes. */
double saga_plan_primitives(double pixels, double changing, double seconds);

/* Returns the CPU minutes that a training takes whose pictures have `pixels`
 * pixels. */
double saga_plan_minutes(double n_primitives, double n_iterations,
                         double pixels);

/* Gives between which bytes the file of a segment is mostly: 4,000 and 9 to 14
 * for each primitive, by docs/results/rd.md. A still's have fewer, the less the
 * fewer iterations there are for each. */
void saga_plan_nbytes(double *least, double *most, double n_primitives,
                      double n_iterations, bool still);

/* Returns the number of primitives that make a file of about n_bytes. */
double saga_plan_primitives_of_size(double n_bytes);

/* Sets n_primitives and n_iterations of o where they are 0, by n_bytes, the
 * preset and the pictures of the segment that is trained first, within the
 * level. Where o has minutes, the iterations stay 0. */
void saga_plan(saga_train_options *o, saga_plan_reasons *why,
               const saga_capture *capture, const saga_preset *preset);

#endif
