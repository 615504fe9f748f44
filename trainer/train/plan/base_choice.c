/* SPDX-License-Identifier: MIT
 *
 * The base holds what stands still in all of the file. It is trained once, on
 * one still picture of every view, and each segment is trained on top of it.
 *
 * The first segment to be trained makes the networks, and its warm-up shows how
 * much stands still. If that is enough for a base, only the networks of this
 * training are kept. The base is trained next, with these networks, and then
 * all segments, the first one again. While a segment is trained, the decoded
 * base is drawn with it, in one depth order, so that the segment learns only
 * the difference.
 */
#include "base_choice.h"

#include "policy.h"
#include "saga.h"
#include "splat_age.h"

#include <math.h>

/* A primitive stands still if it is visible throughout the segment, and its
 * place (in standard deviations of its longest axis) and angle (in radians)
 * change by less than this between the middle of the segment and its ends. */
#define LEAST_MOTION 0.25

/* From this log2 of the temporal width (in segments) on, a primitive counts as
 * always visible, and the time of its centre is worth no bits. */
#define LONG_LIFE R(0.5)

/* A base is made only if it saves at least this part of all primitives, since a
 * segment cannot correct what the base draws. Files of two or three segments
 * with a base had 0 to 1.1 dB less than files of equal size without one, and up
 * to 1.3 dB less on held-out views; files of four or more segments gained
 * (docs/lab/segments.md). */
#define LEAST_SAVED 0.25

/* Each segment keeps at least this part of its primitives. */
#define LEAST_KEPT 0.125

/* A base has at most this many times the primitives that stand still, which
 * bounds the cost of drawing. */
#define MOST_TIMES 3

/* If a size was asked for and a base leaves 1/x of all primitives, base and
 * segments get x^MORE_POWER times as many. The remaining bytes code each of
 * them more exactly: the rule of policy.h gives more bits to a primitive the
 * more of them are drawn, and a primitive on top of a base takes more
 * (docs/lab/size.md). */
#define MORE_POWER 0.67

/* Returns the change of place between the middle of the segment and t, in
 * standard deviations of the primitive's longest axis. */
static double change_of_place(const saga_splat_params *p, size_t i, real t)
{
    const real pace = saga_splat_ageing(p, i);
    const real now = (t - p->t_centre[i]) * pace;
    const real middle = (R(0.5) - p->t_centre[i]) * pace;
    double sum = 0, longest = -INFINITY;

    for (size_t k = 0; k < 3; k++) {
        const real *const b = p->motion + 9 * i + k;
        /* The motion is ((b3 age + b2) age + b1) age. */
        const double d = (double)(((b[6] * now + b[3]) * now + b[0]) * now) -
                         (double)(((b[6] * middle + b[3]) * middle + b[0]) *
                                  middle);

        sum += d * d;
        longest = fmax(longest, (double)p->log2_scale[3 * i + k]);
    }
    /* 2^longest is a standard deviation. */
    return sqrt(sum) * exp2(-longest);
}

/* Returns the angle, in radians, by which the primitive turns in half a
 * segment: twice the change of its quaternion relative to the quaternion's
 * length. */
static double change_of_angle(const saga_splat_params *p, size_t i)
{
    double slope = 0, length = 0;

    for (size_t k = 0; p->slope && k < 4; k++) {
        const double s = (double)p->slope[4 * i + k];
        const double q = (double)p->quat[4 * i + k];

        slope += s * s;
        length += q * q;
    }
    /* slope is per unit of age; ageing / 2 is the age of half a segment. */
    return length > 0
               ? 2 * sqrt(slope / length) * (double)saga_splat_ageing(p, i) / 2
               : 0;
}

bool saga_plan_is_long(const saga_splat_params *p, size_t i)
{
    return !p->log2_width || p->log2_width[i] >= LONG_LIFE;
}

static bool is_still(const saga_splat_params *p, size_t i)
{
    return !p->log2_width || (saga_plan_is_long(p, i) &&
                              change_of_place(p, i, 0) < LEAST_MOTION &&
                              change_of_place(p, i, 1) < LEAST_MOTION &&
                              change_of_angle(p, i) < LEAST_MOTION);
}

saga_train_no_base saga_plan_no_base(const saga_base_question *q)
{
    return q->options->n_segments < 2 ? SAGA_TRAIN_ONE_SEGMENT
           : q->ablation->no_base     ? SAGA_TRAIN_ABLATED
           : q->wanders               ? SAGA_TRAIN_WANDERS
           : q->subject               ? SAGA_TRAIN_SUBJECT
                                      : SAGA_TRAIN_HAS_BASE;
}

/* Returns the factor by which the number of primitives may grow if they are
 * coded once and not once for each of n segments. The error law of policy.h
 * would give the square of this factor; but all primitives of a base learn from
 * the same few still pictures, and the more there are, the less well they show
 * the views between the cameras. */
static double times_for(int n)
{
    const double by_law = saga_policy_primitives(1, 1, n, 1) /
                          saga_policy_primitives(1, 1, 1, 1);

    /* The law gives n^(1 / 1.43) = n^0.7; its square root is n^0.35. */
    return fmin(sqrt(by_law), MOST_TIMES);
}

/* Returns the factor for the number of primitives of the base and of each
 * segment beside it. It is above 1 where a size was asked for: what the base
 * saves is spent on more primitives, up to the level's limit on those drawn
 * together. */
static double filling(const saga_base_question *q, double base, double kept)
{
    const saga_train_options *const o = q->options;
    const double n = o->n_segments;

    /* x is the number of primitives in the file without a base, over that with
     * one. */
    return o->n_bytes == 0
               ? 1
               : fmin(pow(n * o->n_primitives / (base + n * kept), MORE_POWER),
                      q->room / (base + kept));
}

void saga_plan_base(saga_train_base *b, const saga_base_question *q)
{
    const saga_train_options *const o = q->options;
    const double n = o->n_primitives;
    const double times = times_for(o->n_segments);
    double kept, more;

    *b = (saga_train_base){ .why = saga_plan_no_base(q) };
    if (b->why)
        return;
    b->n_looked_at = q->n;
    /* In a capture where nothing moves, every primitive stands still. */
    for (uint32_t i = 0; i < b->n_looked_at; i++)
        b->n_still += !q->moves || is_still(&q->flat, i);
    /* Each of n segments saves n_still primitives, and the base has `times`
     * n_still once: a segment saves n_still (1 - times / n). */
    if (b->n_still * (1 - times / o->n_segments) <
        LEAST_SAVED * b->n_looked_at) {
        b->why = SAGA_TRAIN_MOVES;
        return;
    }
    /* The segments' primitives come first; the base gets what the level's limit
     * leaves, because they are drawn together. */
    kept = fmax(n - b->n_still, LEAST_KEPT * n);
    more = filling(q, b->n_still * times, kept);
    b->n_kept = (uint32_t)ceil(more * kept);
    b->n_prim = (uint32_t)fmin(more * (b->n_still * times),
                               (double)q->room - b->n_kept);
    b->saved = SAGA_PRIMITIVE_BITS / 8 *
               ((n - b->n_kept) * o->n_segments - b->n_prim);
}
