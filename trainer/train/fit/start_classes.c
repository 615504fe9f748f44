/* SPDX-License-Identifier: MIT
 *
 * The classes of anchors: what never moves needs no features for motion, and an
 * affine map of its own gives its attributes from fewer features. Class 0 is
 * that of still primitives, class 1 has all attributes.
 */
#include "start_state.h"

#include "alloc.h"
#include "order.h"
#include "scene_model.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The log2 of a still primitive's temporal width, in half-sizes of its cell,
 * which are 2^-(depth_t + 1) segments. It fades in cells that are much shorter
 * than the segment, unless training makes it longer; to exclude these saved
 * less (docs/lab/classes.md). */
#define STILL_WIDTH 4.0

static const char what[] = "the classes of anchors";

static bool lacks(uint32_t class, int attr)
{
    return class == SAGA_CLASS_STILL && saga_attributes[attr].is_temporal;
}

static uint32_t anchor_of(const saga_scene *s, size_t prim)
{
    return s->fine[s->prim_fine[prim]].parent;
}

/* --- The choice ----------------------------------------------------------- */

/* Returns what the loss grows by if primitive i does not move or fade. A target
 * without an attribute has 0 for it. */
static double cost_of_stillness(const saga_start *x, const saga_scene *s,
                                size_t i)
{
    const saga_splat_params *const p = x->target;
    const double *const weight = x->weight + i * x->d;
    double cost = 0;

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        for (size_t k = 0; k < x->width[a] && p->of[a]; k++)
            if (a == SAGA_ATTR_MOTION || a == SAGA_ATTR_SLOPE) {
                const double v =
                    (double)p->of[a][i * (size_t)saga_attributes[a].width + k];

                cost += weight[x->at[a] + k] * v * v;
            }
    if (p->log2_width && x->width[SAGA_ATTR_LOG2_WIDTH]) {
        /* The width in segments, and the place in time from the middle. */
        const double width = exp2((double)p->log2_width[i]);
        const double at = (double)s->prim_x[4 * i + 3] - 0.5;
        /* The opacity falls by log2(e) (t - at)^2 / width^2. For uniform t in
         * +-1/2 this varies by the variance below about a mean, by which
         * training lowers the opacity. */
        const double fall = 1 / (M_LN2 * width * width);

        cost += weight[x->at[SAGA_ATTR_OPACITY]] * fall * fall *
                (1 / 180.0 + at * at / 3);
    }
    return cost;
}

/* A primitive may be still if that costs less than this many bits, and all
 * still ones together may cost as much as their features for motion take, some
 * twenty bits each. The cost of one is too high, since training makes up for
 * most of it: of limits of 12 to 500 bits, 200 came out best in short
 * trainings (docs/lab/classes.md). */
#define STILL_BITS 200.0
#define STILL_BITS_MEAN 20.0

/* Returns the cost from which on primitives move. cost (n) gets sorted. */
static double limit_of(double *cost, size_t n, double bit)
{
    double sum = 0;
    size_t i;

    /* From the cheapest on, as long as each and all together are in bounds. */
    qsort(cost, n, sizeof *cost, saga_by_value);
    for (i = 0; i < n && cost[i] < STILL_BITS * bit; i++) {
        sum += cost[i];
        if (sum > STILL_BITS_MEAN * bit * (double)(i + 1))
            break;
    }
    return i < n ? cost[i] : HUGE_VAL;
}

bool saga_start_choose_classes(const saga_start *x, saga_fit *f,
                               saga_error *error)
{
    saga_scene *const s = f->scene;
    double *const cost = saga_alloc(2 * x->n, sizeof *cost, what, error);
    double limit;

    if (!cost)
        return false;
    for (uint32_t i = 0; i < s->n.coarse; i++)
        s->coarse[i].class = SAGA_CLASS_STILL;
    for (size_t i = 0; i < x->n; i++)
        cost[i] = cost_of_stillness(x, s, i);
    memcpy(cost + x->n, cost, x->n * sizeof *cost);
    limit = limit_of(cost + x->n, x->n, f->o.price.residual);
    /* Two primitives may share an anchor, which moves if one of them does. */
    for (size_t i = 0; i < x->n && !s->still; i++)
        if (cost[i] >= limit)
            s->coarse[anchor_of(s, i)].class = SAGA_CLASS_MOVING;
    free(cost);
    return true;
}

/* --- The maps ------------------------------------------------------------- */

/* A class with fewer members than this many for each dimension gets the map of
 * all primitives. Later segments use the map, too. */
enum { MEMBERS = 4 };

static bool is_member(const saga_scene *s, size_t prim, uint32_t class)
{
    return s->coarse[anchor_of(s, prim)].class == class;
}

static size_t n_members(const saga_start *x, const saga_scene *s,
                        uint32_t class)
{
    size_t n = 0;

    for (size_t i = 0; i < x->n; i++)
        n += is_member(s, i, class);
    return n;
}

/* Makes y n primitives with the dimensions that the class has. The caller frees
 * it. */
static bool begin_class(saga_start *y, const saga_start *x, const saga_scene *s,
                        uint32_t class, saga_error *error)
{
    const size_t n = n_members(x, s, class);

    *y = (saga_start){ 0 };
    for (int a = 0; a < SAGA_N_ATTRS; a++) {
        y->width[a] = lacks(class, a) ? 0 : x->width[a];
        y->at[a] = y->d;
        y->d += y->width[a];
    }
    y->n = n < MEMBERS * y->d ? x->n : n;
    y->f = s->model.classes[class].n;
    y->f = y->f < y->d ? y->f : y->d;
    y->wanted = saga_calloc(y->n * y->d, sizeof *y->wanted, what, error);
    y->weight = saga_calloc(y->n * y->d, sizeof *y->weight, what, error);
    y->code = saga_calloc(y->n * y->f, sizeof *y->code, what, error);
    return !saga_failed(error);
}

/* Copies what is wanted of the class's primitives, or of all if y has all. */
static void take_class(saga_start *y, const saga_start *x, const saga_scene *s,
                       uint32_t class)
{
    size_t to = 0;

    for (size_t i = 0; i < x->n; i++) {
        if (y->n < x->n && !is_member(s, i, class))
            continue;
        for (int a = 0; a < SAGA_N_ATTRS; a++)
            for (size_t k = 0; k < y->width[a]; k++) {
                const size_t from = i * x->d + x->at[a] + k;

                y->wanted[to * y->d + y->at[a] + k] = x->wanted[from];
                y->weight[to * y->d + y->at[a] + k] = x->weight[from];
            }
        to++;
    }
}

/* Gives x the features of the class's primitives. */
static void give_codes(saga_start *x, const saga_start *y, const saga_scene *s,
                       uint32_t class)
{
    const size_t first = s->model.classes[class].first;
    size_t from = 0;

    for (size_t i = 0; i < x->n; i++) {
        const bool member = is_member(s, i, class);

        for (size_t k = 0; k < y->f && member; k++)
            x->code[i * x->f + first + k] = y->code[from * y->f + k];
        from += member || y->n == x->n;
    }
}

/* Gives x the map of a class. The mean of class 0 is that of all, and the
 * feature `one` of another adds what its own differs by. */
static void give_map(saga_start *x, const saga_start *y, const saga_scene *s,
                     uint32_t class)
{
    const saga_class has = s->model.classes[class];

    for (int a = 0; a < SAGA_N_ATTRS; a++)
        for (size_t k = 0; k < x->width[a]; k++) {
            const size_t row = x->at[a] + k;
            const double mean = !lacks(class, a) ? y->mean[y->at[a] + k]
                                : a == SAGA_ATTR_LOG2_WIDTH ? STILL_WIDTH
                                                            : 0;

            for (size_t j = 0; j < y->f && y->width[a]; j++)
                x->basis[row][has.first + j] = y->basis[y->at[a] + k][j];
            if (has.one < s->model.features)
                x->basis[row][has.one] = mean - x->mean[row];
            else
                x->mean[row] = mean;
        }
}

static bool solve_class(saga_start *x, const saga_scene *s, uint32_t class,
                        double price, double step, saga_error *error)
{
    saga_start y;
    const bool ok = begin_class(&y, x, s, class, error);

    if (ok) {
        take_class(&y, x, s, class);
        saga_start_raise_weights(&y);
        saga_start_solve(&y, price, step);
        give_codes(x, &y, s, class);
        give_map(x, &y, s, class);
    }
    free(y.wanted);
    free(y.weight);
    free(y.code);
    return ok;
}

bool saga_start_solve_classes(saga_start *x, const saga_scene *s, double price,
                              double step, saga_error *error)
{
    memset(x->code, 0, x->n * x->f * sizeof *x->code);
    memset(x->basis, 0, sizeof x->basis);
    for (uint32_t c = 0; c < s->model.n_classes; c++)
        if (!solve_class(x, s, c, price, step, error))
            return false;
    return true;
}

void saga_start_set_lacking(saga_scene *s)
{
    const uint32_t n = s->model.features;

    for (size_t i = 0; s->model.n_classes && i < s->n.coarse; i++) {
        const saga_class has = saga_scene_class(s, i);

        for (uint32_t k = 0; k < n; k++)
            if (!saga_class_has(has, k))
                s->coarse_feature[i * n + k] = k == has.one;
    }
}
