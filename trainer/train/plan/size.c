/* SPDX-License-Identifier: MIT
 *
 * Steers the size of a file to a given number of bytes. The number of
 * primitives decides most of it (policy.h). The rest is steered during the
 * rendering stage: at certain moments the file is made as if training ended
 * there, and the quantisation step of the features is changed by the factor
 * that would give the right size. The price of a bit changes with the square of
 * the step. The last moments are late, when the networks are rounded and hardly
 * anything changes any more.
 *
 * The first training of a file makes the networks and the step, which the base
 * and all segments use. It is steered to the share of the file's size that its
 * share of the primitives suggests. The number of primitives of the next
 * segment follows from the bytes that the finished segments left.
 */
#include "size.h"

#include "saga.h"

#include <math.h>

/* The parts of the rendering stage after which the step is set. */
static const double moment[] = { 0.05, 0.15, 0.3, 0.5, 0.65, 0.7, 0.8, 0.92 };

/* Limits what is drawn of a segment together with the base to this many times
 * the planned number of primitives. A segment itself has at least its planned
 * number divided by this. */
#define MOST_UNLIKE 1.5

/* Returns the part of their present bytes that networks and offsets will take
 * in the end. They shrink while they learn, and again when sources are chosen
 * and features rounded. Fitted to three scenes (docs/lab/size.md). */
static double part_in_the_end(double over)
{
    /* Rounding begins after two thirds (fit.h). From there on the sizes are
     * final. */
    return over > 2 / 3.0 ? 1 : 0.65 + 0.33 * over;
}

/* Returns the square of a value's deviation in steps, up to a constant factor,
 * from its bits: a value with deviation s takes about log2(1 + 2 pi e s^2) / 2
 * bits. */
static double spread_of(double bits)
{
    return exp2(2 * fmax(bits, 0.02)) - 1;
}

/* Returns the factor on the step with which n values take `bits + more` bits in
 * place of `bits`. */
static double step_factor(double bits, double more, double n)
{
    /* b = log2(1 + c s^2) / 2 gives s^2 = (2^(2 b) - 1) / c, and s is
     * proportional to 1 / step. */
    const double ratio = spread_of(bits / n) / spread_of((bits + more) / n);

    /* A moment changes a value by at most one bit; the next moment
     * continues. */
    return fmin(fmax(sqrt(ratio), 0.5), 2);
}

double saga_size_moment(int iteration, int n_render)
{
    for (size_t i = 0; i < sizeof moment / sizeof moment[0]; i++)
        if (iteration == (int)(moment[i] * n_render))
            return moment[i];
    return 0;
}

/* Returns the bytes of a file that do not belong to one segment. */
static double fixed_nbytes(const saga_encode_sizes *z)
{
    return (double)(z->header + z->index + z->networks + z->base);
}

/* Returns the planned number of primitives of a segment, without the base. */
static uint32_t n_planned(const saga_size_terms *t)
{
    return t->base->n_prim ? t->base->n_kept : t->options->n_primitives;
}

/* Returns the number of primitives in the file, base included, in units of the
 * number that the first training has. */
static double n_paid(const saga_size_terms *t)
{
    /* All primitives count as taking equal bytes, including the base's. */
    return (t->base->n_prim + (double)t->options->n_segments * n_planned(t)) /
           t->options->n_primitives;
}

/* Returns by how many bytes the segment may still grow, after the part `over`
 * of the rendering stage; negative if it is too large. */
static double left_for(const saga_size_terms *t, double over)
{
    const saga_encode_sizes *const z = t->sizes;
    const double saved = 1 - part_in_the_end(over);
    /* All trainings share the size, less what the file holds once. Bytes that
     * the networks are still going to save go to values. */
    const double all = (double)t->options->n_bytes - fixed_nbytes(z) +
                       saved * (double)z->networks;

    /* The share of this training, plus what its offsets are still going to
     * save, less what its values take now. */
    return all / n_paid(t) + saved * (double)z->prim -
           ((double)z->total - fixed_nbytes(z));
}

double saga_size_step(const saga_size_terms *t, double over, double n)
{
    /* Offsets and tree cannot be steered, so features take all bytes that are
     * left. */
    return step_factor(t->sizes->spent[SAGA_SYM_FEATURE], 8 * left_for(t, over),
                       n);
}

uint32_t saga_size_share(const saga_size_terms *t, int n_done,
                         uint64_t n_finished)
{
    const saga_encode_sizes *const z = t->sizes;
    const double n = n_planned(t), base = t->base->n_prim;
    double of_one, left;

    if (t->options->n_bytes == 0 || n_done == 0)
        return n_planned(t);
    /* Bytes per primitive in the finished segments. */
    of_one = ((double)z->total - fixed_nbytes(z)) / (double)n_finished;
    /* Bytes left for each of the segments to come. */
    left = ((double)t->options->n_bytes - (double)z->total) /
           (t->options->n_segments - n_done);
    /* A segment gets at least two thirds of its planned number of primitives.
     * Together with the base it gets at most 1.5 times the planned sum, and no
     * more than the level allows. */
    return (uint32_t)fmin(fmin(fmax(left / of_one, n / MOST_UNLIKE),
                               MOST_UNLIKE * (n + base) - base),
                          t->room - base);
}
