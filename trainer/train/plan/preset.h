/* SPDX-License-Identifier: MIT
 *
 * Plans what the user left open, the number of primitives and of iterations,
 * from the capture and the preset. It also gives the reasons as sentences.
 */
#ifndef SAGA_PRESET_H
#define SAGA_PRESET_H

#include "options.h"

/* A preset decides how much work is put into a file; docs/presets.md has a
 * table. Options that the user gave take precedence. */
typedef struct saga_preset {
    const char *name;
    double primitives;    /* factor on the rule's number of primitives;
                           * more of them show finer detail, and take
                           * bytes and time */
    int iterations;       /* least iterations of all stages together */
    int visits;           /* least visits to each picture */
    double still_minutes; /* longest time for a still, by
                           * saga_plan_minutes; 0: no limit */
    int still_visits;     /* least visits to each picture of a still,
                           * which override still_minutes */
    int teachers;         /* teachers, where cameras are far apart
                           * (rig/novel.h); two of them take some 20 %
                           * more time, for a still 50 % */
    const char *plus;     /* its advantage over the previous preset, for
                           * the help */
    const char *better;   /* name of the preset to try if the result is
                           * not good enough; NULL: none */
} saga_preset;

/* Return a preset by its number, from the quickest on (NULL: past the last),
 * and by its name (NULL: unknown). */
const saga_preset *saga_preset_at(int number);
const saga_preset *saga_preset_called(const char *name);

/* Each is one sentence without a full stop, or empty if nothing was left
 * open. */
typedef struct saga_plan_reasons {
    char primitives[160], iterations[160];
    double wanted; /* primitives that suit the capture, if the
                    * level has no room for them; otherwise 0 */
} saga_plan_reasons;

/* A segment has at most this many frames. */
enum { SAGA_PLAN_MOST_FRAMES = 65535 };

/* Returns the number of segments in which a capture is trained. Only the number
 * of its frames, its frame rate and `moves` are read. A segment has about
 * `frames` frames; where that is 0, ten seconds, but at least 24 frames. A
 * camera that moves has one segment. */
int saga_plan_segments(const saga_capture *capture, int frames);

/* Returns N if the pictures of a still should be trained at 1/N of their size.
 * It is 1 if whole pictures can be visited still_visits times within
 * still_minutes; otherwise the least N with which they can, in at least 500
 * iterations and with at least 100,000 pixels left in a picture. The number of
 * primitives follows the pixels. It is 1 too if the user gave iterations or
 * minutes. c: a capture whose files were listed, not loaded. */
int saga_plan_scale(const saga_train_options *o, const saga_capture *c,
                    const saga_preset *p);

/* Returns the number of primitives for a segment that lasts `seconds`. pixels:
 * at one moment, of all views together; changing: the part of them that
 * changes, 0..1. */
double saga_plan_primitives(double pixels, double changing, double seconds);

/* Returns the CPU minutes of a training whose pictures have this mean number of
 * pixels. */
double saga_plan_minutes(double n_primitives, double n_iterations,
                         double pixels);

/* Returns about the most anonymous memory that a training takes, in bytes,
 * besides the pictures of its capture. largest: the pixels of the largest
 * picture. */
double saga_plan_memory(double n_primitives, double largest);

/* Sets *least and *most to the range in which the size of a file mostly lies.
 * Primitives and iterations are those of all its segments, frames those of one.
 * Of a film this is a number off by up to a quarter: 2,800 bytes, 90 for each
 * camera and 12.85 for each primitive, or fewer if the segment has more than 32
 * frames. The file of a still (one frame) has 4 to 14 bytes for each primitive,
 * the fewer the fewer iterations. */
void saga_plan_nbytes(double *least, double *most, double n_primitives,
                      double n_iterations, int n_frames, int n_views);

/* Returns the number of primitives that make a file of about n_bytes bytes. */
double saga_plan_primitives_of_size(double n_bytes);

/* Returns the least number of primitives that saga_plan may choose, or the one
 * that is given. c: a capture whose files were listed, not loaded, so that it
 * is not known how much of it changes. */
uint32_t saga_plan_least(const saga_train_options *o, const saga_capture *c,
                         const saga_preset *preset);

/* Sets n_primitives and n_iterations of *o where they are 0, from n_bytes, the
 * preset and the pictures of the first segment to be trained. The number of
 * primitives is one that the level has room for, whatever tools are chosen. If
 * o->minutes is set, n_iterations stays 0. */
void saga_plan(saga_train_options *o, saga_plan_reasons *why,
               const saga_capture *capture, const saga_preset *preset);

#endif
