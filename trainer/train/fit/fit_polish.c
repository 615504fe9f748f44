/* SPDX-License-Identifier: MIT */
#include "fit_polish.h"

#include "alloc.h"
#include "cost.h"
#include "fit_state.h"
#include "novel.h"
#include "prob.h"
#include "threads.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* Streams of random numbers. */
enum { STREAM_PICTURES = 120, STREAM_SIGNS, STREAM_BLOCKS };

/* A fit that has visited every picture LEAST_VISITS times has two turns, and
 * one more for every further MORE_VISITS visits, up to MOST_TURNS, since each
 * turn gains less than the previous one. */
enum { LEAST_VISITS = 4, MORE_VISITS = 4, MOST_TURNS = 4 };

/* A turn draws at most this part of the rendering stage's iterations; a film of
 * many pictures would otherwise take as long for its polish as for the stage
 * itself. So 16 visits to each picture draw all, and 8 draw half, which loses
 * at most 0.03 dB (docs/lab/coding.md). */
enum { PART_OF_STAGE = 16 };

/* The first turn moves this part of the blocks, and each further turn this
 * fraction of the previous part. Blocks that overlap correct the same error, so
 * that moving all at once would overshoot. For the same reason the curvature
 * counts this many times as much as it would if nothing else moved. */
#define FIRST_PART 0.5
#define NEXT_PART 0.75
#define CURVATURE 1.5

static const char what[] = "the polish of the features";

typedef struct {
    saga_fit *f;
    saga_twin *twin;        /* twin of the decoded scene */
    size_t width, n_blocks; /* number of features in a block */
    uint64_t n_pictures;    /* of those that were trained, drawn by chance */
    saga_rng pictures;
    real *feature, *slope;   /* (blocks, F): decoded features, and dD / d
                              * feature */
    real *best, *best_slope; /* (blocks, F): the same at the least loss so
                              * far */
    real *curve;             /* (blocks, F) d2D / d feature^2 */
    double step;             /* quantisation step of a feature */
    double price;            /* price of a bit */
    double loss;             /* D + price R of the decoded scene */
} polish;

/* --- How much ------------------------------------------------------------- */

/* Returns the number of turns after n_render iterations on n_there pictures.
 * The pictures are drawn once for the curvature, once before the first turn and
 * once after each turn. */
static int n_turns(int n_render, int n_there)
{
    const int visits = n_render / n_there;
    const int n = 2 + (visits - LEAST_VISITS) / MORE_VISITS;

    return visits < LEAST_VISITS ? 0 : n > MOST_TURNS ? MOST_TURNS : n;
}

static int n_drawn(int n_render, int n_there)
{
    const int most = (n_render - 1) / PART_OF_STAGE + 1;

    return most < n_there ? most : n_there;
}

int saga_fit_polish_draws(int n_render, int n_there)
{
    const int n = n_turns(n_render, n_there);

    return n ? (n + 2) * n_drawn(n_render, n_there) : 0;
}

static bool init(polish *p, saga_fit *f, saga_error *error)
{
    const size_t n = (size_t)f->scene->n.coarse * f->scene->model.features;

    *p = (polish){ .f = f,
                   .width = f->scene->model.features,
                   .n_blocks = f->scene->n.coarse,
                   .n_pictures = (uint64_t)n_drawn(f->o.n_render,
                                                   f->pictures->n_there),
                   .pictures = saga_rng_stream(f->o.seed, STREAM_PICTURES),
                   .step = saga_fit_feature_step(f->scene),
                   .price = f->o.price.residual };
    p->feature = saga_calloc(5 * n, sizeof *p->feature, what, error);
    if (!p->feature)
        return false;
    p->slope = p->feature + n;
    p->best = p->slope + n;
    p->best_slope = p->best + n;
    p->curve = p->best_slope + n;
    return true;
}

/* --- Pictures ------------------------------------------------------------- */

/* Sets the features to their decoded values, the twin that draws them, and
 * p->loss to the price of their bits. */
static bool decode(polish *p, saga_error *error)
{
    saga_rate_choice choice;

    p->twin = saga_fit_code(p->f, p->feature, &choice, error);
    if (!p->twin)
        return false;
    p->loss = 0;
    for (int i = 0; i < SAGA_N_STEPS; i++)
        p->loss += p->price * choice.bits[i];
    saga_rate_choice_free(&choice);
    return true;
}

static void clear_gradients(polish *p)
{
    saga_clear(
        &(saga_span){ p->f->grad.reals, p->f->grad.n_reals * sizeof(real) }, 1);
    saga_twin_clear(p->twin, p->f->scene);
}

/* Aims the canvas at a picture and computes the colours that its camera
 * sees. */
static bool show(polish *p, uint64_t number, saga_error *error)
{
    saga_fit *const f = p->f;

    if (!saga_novel_show(&f->canvas, f->pictures,
                         saga_novel_pick(f->pictures, p->pictures, number),
                         error))
        return false;
    saga_twin_colour(p->twin, saga_fit_scene(f), f->canvas.camera.centre);
    return true;
}

/* Draws the pictures of the decoded scene; adds their error to the loss and
 * sets its slope. */
static bool look(polish *p, saga_error *error)
{
    saga_fit *const f = p->f;
    const saga_scene *const s = saga_fit_scene(f);
    const size_t n = p->n_blocks * p->width;

    clear_gradients(p);
    for (uint64_t i = 0; i < p->n_pictures; i++) {
        saga_splat_learning l = { .d = p->twin->d_attr };

        if (!show(p, i, error) ||
            !saga_splat_learn(&l, &f->canvas, &p->twin->attr, s->n.prim, error))
            return false;
        p->loss += l.mse / (double)p->n_pictures;
        saga_twin_colour_backward(p->twin, &f->grad, s);
    }
    saga_twin_backward(p->twin, &f->grad, s);
    for (size_t i = 0; i < n; i++)
        p->slope[i] = f->grad.coarse_feature[i] / (real)p->n_pictures;
    return true;
}

/* Adds a sample of the curvature, from a picture of random signs (start.c does
 * the same for attributes). */
static bool add_signs(polish *p, uint64_t number, saga_error *error)
{
    saga_fit *const f = p->f;
    saga_canvas *const c = &f->canvas;
    const saga_scene *const s = saga_fit_scene(f);
    const saga_rng r = saga_rng_stream(f->o.seed, STREAM_SIGNS);
    size_t n;

    clear_gradients(p);
    if (!show(p, number, error) ||
        !saga_splat_forward(c, &p->twin->attr, s->n.prim, error))
        return false;
    n = 3 * (size_t)c->camera.width * (size_t)c->camera.height;
    saga_canvas_draw_signs(c, r, (number + 1) << 32);
    if (!saga_splat_backward(&p->twin->d_attr, NULL, c, &p->twin->attr, error))
        return false;
    saga_twin_colour_backward(p->twin, &f->grad, s);
    saga_twin_backward(p->twin, &f->grad, s);
    for (size_t i = 0; i < p->n_blocks * p->width; i++) {
        const real g = f->grad.coarse_feature[i];

        /* D is the mean of n squares, over all pictures, so its second
         * derivative is twice the mean of J^2. */
        p->curve[i] += 2 * g * g / ((real)n * (real)p->n_pictures);
    }
    return true;
}

static bool find_curvature(polish *p, saga_error *error)
{
    for (uint64_t i = 0; i < p->n_pictures; i++)
        if (!add_signs(p, i, error))
            return false;
    return true;
}

/* --- Moves ---------------------------------------------------------------- */

/* The coded form of a feature. */
typedef struct {
    uint32_t scale;
    int32_t symbol;
} coded;

static coded code_of(const polish *p, size_t block, size_t i)
{
    const saga_model *const m = &p->f->scene->model;
    const saga_rate_kind *const k = &p->f->rate.context.kind[SAGA_KIND_COARSE];
    const size_t at = block * saga_n_channels(m, SAGA_KIND_COARSE) + 4 + i;
    const double sigma = ldexp((double)k->log2_sigma[at], SAGA_COST_SIGMA_Q);
    const double off = (double)(p->best[block * p->width + i] - k->mu[at]);

    return (coded){ saga_prob_index((int16_t)lrint(sigma), SAGA_COST_SIGMA_Q),
                    (int32_t)rint(off / p->step) };
}

/* Returns the change of the loss when feature `at` moves by one step, up or
 * down. */
static double added(const polish *p, size_t at, const coded *c, int by)
{
    const int32_t to = c->symbol + by;

    if (to < -SAGA_MAX_RESIDUAL || to > SAGA_MAX_RESIDUAL)
        return HUGE_VAL;
    return by * p->step * (double)p->best_slope[at] +
           CURVATURE * p->step * p->step * (double)p->curve[at] / 2 +
           p->price * (saga_cost_residual(to, c->scale) -
                       saga_cost_residual(c->symbol, c->scale));
}

/* Moves the one feature of a block that gains most. A second move would rely on
 * gradients that the first one changed, since both affect the same primitive.
 * Returns the predicted gain. */
static double move_block(const polish *p, size_t block)
{
    const saga_class has = saga_scene_class(p->f->scene, block);
    const size_t first = block * p->width;
    double least = 0;
    size_t best = first;
    int move = 0;

    for (size_t i = has.first; i < (size_t)has.first + has.n; i++) {
        const coded c = code_of(p, block, i);

        for (int by = -1; by <= 1; by += 2) {
            const double d = added(p, first + i, &c, by);

            if (d < least) {
                least = d;
                best = first + i;
                move = by;
            }
        }
    }
    p->f->scene->coarse_feature[best] += (real)(move * p->step);
    return -least;
}

/* Sets the scene's features to the best ones so far and moves a part of their
 * blocks. Returns the predicted gain. */
static double move_some(const polish *p, int turn, double part)
{
    const saga_rng r = saga_rng_stream(p->f->o.seed + (uint64_t)turn,
                                       STREAM_BLOCKS);
    double gain = 0;

    memcpy(p->f->scene->coarse_feature, p->best,
           p->n_blocks * p->width * sizeof *p->best);
    for (size_t i = 0; i < p->n_blocks; i++)
        if (saga_rng_double(r, i) < part)
            gain += move_block(p, i);
    return gain;
}

/* --- Turns ---------------------------------------------------------------- */

static bool take_turns(polish *p, saga_fit_polished *r, saga_error *error)
{
    const size_t nbytes = 2 * p->n_blocks * p->width * sizeof *p->best;
    double part = FIRST_PART, gain = 0;

    for (int turn = 0; turn <= r->n_turns; turn++, part *= NEXT_PART) {
        /* The curvature at the first decode is used for all turns. */
        if (!decode(p, error) || (turn == 0 && !find_curvature(p, error)) ||
            !look(p, error))
            return false;
        if (turn == 0)
            r->before = r->after = p->loss;
        if (turn == 0 || p->loss < r->after) {
            /* feature and slope are adjacent in memory, and so are best and
             * best_slope. */
            memcpy(p->best, p->feature, nbytes);
            r->after = p->loss;
            r->foretold += gain;
        }
        /* After the last turn, a part of 0 restores the best features. */
        gain = move_some(p, turn, turn < r->n_turns ? part : 0);
    }
    return true;
}

bool saga_fit_polish(saga_fit *f, saga_fit_polished *r, saga_error *error)
{
    polish p;
    bool ok;

    *r = (saga_fit_polished){ 0 };
    if (!f->o.given && f->scene->n_layers == 1)
        r->n_turns = n_turns(f->o.n_render, f->pictures->n_there);
    if (r->n_turns == 0)
        return true;
    ok = init(&p, f, error) && take_turns(&p, r, error);
    free(p.feature);
    return ok;
}
