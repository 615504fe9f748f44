/* SPDX-License-Identifier: MIT
 *
 * The base: what stands still in all of the file is trained once, on a still
 * picture of every view, and each segment on top of it.
 *
 * The first segment to be trained makes the networks, and its warm-up shows how
 * much stands still. Where that is enough, nothing but the networks is kept of
 * it: then come the base, which finds features for them as every other segment
 * does, and all segments, the first one again. They are drawn together with the
 * base as it is decoded, in one order of depth, and learn what it is not.
 */
#include "base_choice.h"

#include "model.h"
#include "policy.h"
#include "saga.h"
#include "splat_animate.h"

#include <math.h>

/* A primitive stands still that lives through the segment, and whose place and
 * angle (of its length and in radians) change less than that in it. */
#define LEAST_MOTION 0.25

/* log2 of the temporal width, in segments, from which on a primitive counts as
 * always there: the moment of its centre is worth no bits. */
#define LONG_LIFE R(0.5)

/* A base that saves less than this part of all primitives is not made. What is
 * drawn before it cannot mend it: of two or three segments those with one had 0
 * to 1.1 dB less than others of as many bytes, and up to 1.3 dB less held out;
 * of four and more they gained (docs/lab/segments.md). */
#define LEAST_SAVED 0.25

/* The segments keep this part of the primitives at least. */
#define LEAST_KEPT 0.125

/* Most primitives of a base, over those that stand still: a bound on what
 * drawing costs. */
#define MOST_TIMES 3

/* Where a size was asked for and a base leaves 1/x of all primitives, base and
 * segments have x^MORE_POWER times as many. The other bytes make each of them
 * more exact: by the rule bits are cheaper where more is drawn, and on a base a
 * primitive takes more of them (docs/lab/size.md). */
#define MORE_POWER 0.67

/* Returns the place's change between mid-segment and t, in standard deviations
 * of the primitive's longest axis. */
static double change_of_place(const saga_splat_params *p, size_t i, real t)
{
    const real pace = saga_splat_ageing(p, i);
    const real now = (t - p->t_centre[i]) * pace;
    const real middle = (R(0.5) - p->t_centre[i]) * pace;
    double sum = 0, longest = -INFINITY;

    for (size_t k = 0; k < 3; k++) {
        const real *const b = p->motion + 9 * i + k;
        /* Horner: ((b3 age + b2) age + b1) age, now less mid-segment. */
        const double d =
            (double)(((b[6] * now + b[3]) * now + b[0]) * now) -
            (double)(((b[6] * middle + b[3]) * middle + b[0]) * middle);

        sum += d * d;
        longest = fmax(longest, (double)p->log2_scale[3 * i + k]);
    }
    /* 2^longest is a standard deviation. */
    return sqrt(sum) * exp2(-longest);
}

/* A quaternion that changes by a small part of its length turns by twice as
 * many radians. */
static double change_of_angle(const saga_splat_params *p, size_t i)
{
    double slope = 0, length = 0;

    for (size_t k = 0; k < 4; k++) {
        const double s = (double)p->slope[4 * i + k];
        const double q = (double)p->quat[4 * i + k];

        slope += s * s;
        length += q * q;
    }
    /* Slope is per age: times ageing, and half a segment from the middle to
     * either end. */
    return length > 0
        ? 2 * sqrt(slope / length) * (double)saga_splat_ageing(p, i) / 2 : 0;
}

bool saga_plan_is_long(const saga_splat_params *p, size_t i)
{
    return !p->log2_width || p->log2_width[i] >= LONG_LIFE;
}

static bool is_still(const saga_splat_params *p, size_t i)
{
    return !p->log2_width ||
           (saga_plan_is_long(p, i) &&
            change_of_place(p, i, 0) < LEAST_MOTION &&
            change_of_place(p, i, 1) < LEAST_MOTION &&
            change_of_angle(p, i) < LEAST_MOTION);
}

saga_train_no_base saga_plan_no_base(const saga_base_question *q)
{
    return q->options->n_segments < 2 ? SAGA_TRAIN_ONE_SEGMENT
         : q->ablation->no_base ? SAGA_TRAIN_ABLATED
         : q->wanders ? SAGA_TRAIN_WANDERS : SAGA_TRAIN_HAS_BASE;
}

/* Returns how many times as many primitives are worth their bits where these
 * are sent once for n segments. By the law of the errors (policy.h) it would be
 * the square of that; but all learn from the same few still pictures, and the
 * more there are, the less they know of the places between. */
static double times_for(int n)
{
    const double by_law = saga_policy_primitives(1, 1, n, 1) /
                          saga_policy_primitives(1, 1, 1, 1);

    /* The law gives n^(1 / 1.43) = n^0.7; its root is n^0.35. */
    return fmin(sqrt(by_law), MOST_TIMES);
}

/* Returns by what to multiply the primitives of a base, and those that each
 * segment keeps: where a size was asked for, what a base saves is spent on
 * more of them, if the level has room for what is drawn together. */
static double filling(const saga_train_options *o, double base, double kept)
{
    const double n = o->n_segments;

    /* x is what all segments would have without a base over what is left with
     * one. */
    return o->n_bytes == 0 ? 1
         : fmin(pow(n * o->n_primitives / (base + n * kept), MORE_POWER),
                saga_caps[o->level].n_prim / (base + kept));
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
    /* In a still capture everything stands still. */
    for (uint32_t i = 0; i < b->n_looked_at; i++)
        b->n_still += !q->moves || is_still(&q->flat, i);
    /* In each of n segments n_still are saved, and the base has `times` of them
     * once: n_still (1 - times / n) for each segment. */
    if (b->n_still * (1 - times / o->n_segments) <
        LEAST_SAVED * b->n_looked_at) {
        b->why = SAGA_TRAIN_MOVES;
        return;
    }
    /* Segments first, the base has what the level leaves: they are drawn
     * together. */
    kept = fmax(n - b->n_still, LEAST_KEPT * n);
    more = filling(o, b->n_still * times, kept);
    b->n_kept = (uint32_t)ceil(more * kept);
    b->n_prim = (uint32_t)fmin(more * (b->n_still * times),
                               saga_caps[o->level].n_prim - b->n_kept);
    b->saved = SAGA_PRIMITIVE_BITS / 8 *
               ((n - b->n_kept) * o->n_segments - b->n_prim);
}
