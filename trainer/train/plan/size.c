/* SPDX-License-Identifier: MIT
 *
 * A file of a given size. The number of primitives decides on most of it
 * (policy.h); the rest is steered while they are rendered. At some moments the
 * file is made as if training ended there, and the features' step becomes what
 * brings it to the size wanted; the price of a bit goes with the step's square.
 * The last moments come when networks are rounded and hardly anything moves.
 *
 * Base and further segments have the networks and the step of the first
 * training, which is steered to its primitives' part of the size. Segments'
 * primitives are what the finished ones left bytes for.
 */
#include "size.h"

#include "model.h"
#include "saga.h"

#include <math.h>

/* Parts of the rendering that are over. */
static const double moment[] = { 0.05, 0.15, 0.3, 0.5, 0.65, 0.7, 0.8, 0.92 };

/* Most primitives that are drawn of a segment, the base's too, over those
 * that were planned; a segment's own are at least what was planned for it
 * over this. */
#define MOST_UNLIKE 1.5

/* Networks and offsets take less the longer they learn, and what they take in
 * the end when sources are chosen and features rounded: until then this part of
 * what they take now, by three scenes (docs/lab/size.md). */
static double part_in_the_end(double over)
{
    /* Two thirds are where rounding begins (fit.h); after them all is
     * measured. */
    return over > 2 / 3.0 ? 1 : 0.65 + 0.33 * over;
}

/* A value whose deviation is s steps takes some log2(1 + 2 pi e s^2) / 2 bits;
 * this is s^2 but for a factor. */
static double spread_of(double bits)
{
    return exp2(2 * fmax(bits, 0.02)) - 1;
}

/* Returns by what to multiply the step of n values that take `bits` bits, for
 * `more` bits more. */
static double step_factor(double bits, double more, double n)
{
    /* b = log2(1 + c s^2) / 2 bits make s^2 = (2^(2 b) - 1) / c, and s, in
     * steps, goes with 1 / step. */
    const double ratio = spread_of(bits / n) / spread_of((bits + more) / n);

    /* By no more than a bit a value at a time: the next moment goes on. */
    return fmin(fmax(sqrt(ratio), 0.5), 2);
}

double saga_size_moment(int iteration, int n_render)
{
    for (size_t i = 0; i < sizeof moment / sizeof moment[0]; i++)
        if (iteration == (int)(moment[i] * n_render))
            return moment[i];
    return 0;
}

/* Returns what a file of these sizes spends on all segments together. */
static double fixed_nbytes(const saga_encode_sizes *z)
{
    return (double)(z->header + z->index + z->networks + z->base);
}

/* Returns the primitives that were planned for a segment, beside the base. */
static uint32_t n_planned(const saga_size_terms *t)
{
    return t->base->n_prim ? t->base->n_kept : t->options->n_primitives;
}

/* Returns the trainings that the size pays for: how many times the primitives
 * of the first there are in the file, the base's among them. */
static double n_paid(const saga_size_terms *t)
{
    /* In bytes all primitives count alike, those of the base too. */
    return (t->base->n_prim +
            (double)t->options->n_segments * n_planned(t)) /
           t->options->n_primitives;
}

/* Returns the bytes that the segment may still take, or is too large by where
 * they are negative, when so much of the rendering is over. */
static double left_for(const saga_size_terms *t, double over)
{
    const saga_encode_sizes *const z = t->sizes;
    const double saved = 1 - part_in_the_end(over);
    /* The size, less what the file has once, is shared by all trainings. What
     * networks will still save is left for values. */
    const double all = (double)t->options->n_bytes - fixed_nbytes(z) +
                       saved * (double)z->networks;

    /* This training's share, with what offsets will still save, less what its
     * values take now. */
    return all / n_paid(t) + saved * (double)z->prim -
           ((double)z->total - fixed_nbytes(z));
}

double saga_size_step(const saga_size_terms *t, double over, double n)
{
    /* Offsets and tree are what they are: features take up all that is left. */
    return step_factor(t->sizes->spent[SAGA_SYM_FEATURE],
                       8 * left_for(t, over), n);
}

uint32_t saga_size_share(const saga_size_terms *t, int n_done,
                         uint64_t n_finished)
{
    const saga_encode_sizes *const z = t->sizes;
    const double n = n_planned(t), base = t->base->n_prim;
    double of_one, left;

    if (t->options->n_bytes == 0 || n_done == 0)
        return n_planned(t);
    /* Bytes that a primitive took in the finished segments. */
    of_one = ((double)z->total - fixed_nbytes(z)) / (double)n_finished;
    /* The bytes that are left for each of the segments to come. */
    left = ((double)t->options->n_bytes - (double)z->total) /
           (t->options->n_segments - n_done);
    /* Between two thirds of the plan and half as many more as are drawn, the
     * base's counted; the level's limit is for both together. */
    return (uint32_t)fmin(fmin(fmax(left / of_one, n / MOST_UNLIKE),
                               MOST_UNLIKE * (n + base) - base),
                          saga_caps[t->options->level].n_prim - base);
}
