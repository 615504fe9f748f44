/* SPDX-License-Identifier: MIT
 *
 * The optimisers of the fit: which tensor is moved by which, and their state
 * between iterations. Another optimiser needs changes in this file, in
 * saga_descent, and to the rates of fit_schedule.c.
 */
#include "fit_state.h"

#include "adam.h"
#include "alloc.h"
#include "block_adam.h"

#include <assert.h>
#include <stdlib.h>

enum { T_FEATURE, T_PRIM, T_ENTROPY, T_BANK, T_PARAMS, T_STEPS, N_TENSORS };

/* --- State --------------------------------------------------------------- */

static void set_spans(saga_fit *f)
{
    for (size_t i = 0; i < f->scene->n.coarse; i++) {
        const saga_class has = saga_scene_class(f->scene, i);

        f->descent.span[i] = (saga_block_span){ has.first, has.n };
    }
}

/* The features of an anchor are one block. F_geo computes attributes from their
 * sums, so their gradients are correlated, differently at each anchor. */
static saga_block_adam feature_blocks(saga_fit *f)
{
    const saga_scene *const s = f->scene;
    const saga_descent *const d = &f->descent;
    const size_t at = (size_t)(s->coarse_feature - s->reals);

    return (saga_block_adam){ .x = s->coarse_feature,
                              .g = f->grad.reals + at,
                              .span = d->span,
                              .state = d->blocks,
                              .n = s->n.coarse,
                              .width = d->width,
                              .stride = s->model.features };
}

static size_t n_blocks_state(const saga_fit *f)
{
    return saga_block_adam_size(f->scene->n.coarse, f->descent.width);
}

size_t saga_fit_width(const saga_model *m)
{
    size_t most = saga_class_of(m, 0).n;

    for (uint32_t i = 1; i < m->n_classes; i++)
        most = m->classes[i].n > most ? m->classes[i].n : most;
    return (most + 3) / 4 * 4;
}

static real *zeros(size_t n, saga_error *error)
{
    return saga_calloc(n, sizeof(real), "the fit", error);
}

/* Has the device step the features, if there is one that can have their
 * state. */
static bool begin_away(saga_fit *f, saga_error *error)
{
    saga_descent *const d = &f->descent;

    if (!f->o.gpu ||
        !saga_gpu_has_blocks(f->o.gpu, f->scene->n.coarse, d->width))
        return true;
    d->away = saga_gpu_blocks_new(f->o.gpu, error);
    return d->away != NULL;
}

bool saga_fit_begin_descent(saga_fit *f, saga_error *error)
{
    saga_descent *const d = &f->descent;
    saga_block_adam features;

    d->width = saga_fit_width(&f->scene->model);
    d->span = saga_calloc(f->scene->n.coarse, sizeof *d->span, "the fit",
                          error);
    d->m = zeros(f->scene->n_reals, error);
    d->v = zeros(f->scene->n_reals, error);
    d->blocks = saga_aligned_alloc(64, n_blocks_state(f) * sizeof *d->blocks,
                                   "the fit", error);
    if (!d->span || !d->m || !d->v || !d->blocks)
        return false;
    features = feature_blocks(f);
    saga_block_adam_begin(&features);
    return begin_away(f, error);
}

void saga_fit_free_descent(saga_fit *f)
{
    free(f->descent.m);
    free(f->descent.v);
    free(f->descent.blocks);
    free(f->descent.span);
    saga_gpu_blocks_free(f->descent.away);
}

saga_block_adam saga_fit_features(saga_fit *f)
{
    saga_block_adam features = feature_blocks(f);

    set_spans(f);
    features.rate = saga_fit_rates_now(f).feature;
    return features;
}

void saga_fit_walk_descent(saga_fit *f, saga_checkpoint *c)
{
    saga_descent *const d = &f->descent;
    const size_t n = f->scene->n_reals;

    /* The device has an older state than the one that is read. */
    d->is_away = d->is_away && !c->reading;
    assert(!d->is_newer && !f->is_newer_there);

    saga_checkpoint_walk(c, d->m, n * sizeof *d->m);
    saga_checkpoint_walk(c, d->v, n * sizeof *d->v);
    saga_checkpoint_walk(c, d->blocks, n_blocks_state(f) * sizeof *d->blocks);
}

/* --- Step ---------------------------------------------------------------- */

static void tensor(saga_adam_tensor *t, saga_fit *f, const char *name, real *x,
                   size_t n, real rate)
{
    const size_t at = (size_t)(x - f->scene->reals);

    t->name = name;
    t->x = x;
    t->g = f->grad.reals + at;
    t->m = f->descent.m + at;
    t->v = f->descent.v + at;
    t->n = n;
    t->rate = rate;
}

static void list_tensors(saga_adam_tensor t[N_TENSORS], saga_fit *f,
                         const saga_fit_rates *r)
{
    saga_scene *const s = f->scene;
    /* The entropy networks come first in params, and the bank's are the last of
     * them. */
    const size_t n_entropy = saga_rate_n_params(s);
    const size_t n_bank =
        s->net[SAGA_NET_QUERY].n_layers
            ? n_entropy - (size_t)(s->net[SAGA_NET_QUERY].w[0] - s->params)
            : 0;
    const size_t still = saga_fit_n_still(f);
    const size_t first = still > n_entropy ? still : n_entropy;

    /* Positions of anchors are in no tensor, since they are fixed. Features are
     * listed only so that they are checked; they are moved by blocks, below. */
    tensor(&t[T_FEATURE], f, "coarse features", s->coarse_feature,
           f->is_there ? 0 : (size_t)s->n.coarse * s->model.features, 0);
    tensor(&t[T_PRIM], f, "primitive positions", s->prim_x,
           f->is_there ? 0 : 4 * (size_t)s->n.prim, r->prim);
    tensor(&t[T_ENTROPY], f, "entropy networks", s->params, n_entropy - n_bank,
           r->entropy);
    /* The bank has gradients only where its reads are evaluated again. With
     * rate 0 its moments stay unchanged until then. */
    tensor(&t[T_BANK], f, "memory bank's networks",
           s->params + n_entropy - n_bank, n_bank,
           saga_fit_is_remembering(f) ? SAGA_BANK_TWIN_PACE * r->entropy : 0);
    /* The networks move from the first layer on that is not rounded yet. */
    tensor(&t[T_PARAMS], f, "networks", s->params + first,
           saga_fit_n_params(s) - first, r->networks);
    t[T_STEPS] = (saga_adam_tensor){ "steps of the networks",
                                     f->weights.log2_step,
                                     f->weights.d_log2_step,
                                     f->weights.m,
                                     f->weights.v,
                                     (size_t)f->weights.n,
                                     r->steps };
}

/* Steps the features on the device, to which they go in the first step. */
static bool step_away(saga_fit *f, const saga_block_adam *features,
                      const saga_adam *adam, saga_error *error)
{
    saga_descent *const d = &f->descent;

    d->is_away = d->is_away || saga_gpu_blocks_put(d->away, features, error);
    d->is_newer = d->is_away;
    return d->is_away &&
           saga_gpu_blocks_step(d->away, features, adam,
                                (uint64_t)f->iteration + 1, error);
}

bool saga_fit_descend(saga_fit *f, saga_error *error)
{
    const saga_adam adam = saga_adam_default();
    const saga_fit_rates rates = saga_fit_rates_now(f);
    const uint64_t number = (uint64_t)f->iteration + 1;
    const saga_block_adam features = saga_fit_features(f);
    saga_adam_tensor t[N_TENSORS];

    list_tensors(t, f, &rates);
    if (!saga_adam_update(&adam, t, N_TENSORS, number, error))
        return false;
    if (f->is_there)
        return true;
    if (f->descent.away)
        return step_away(f, &features, &adam, error);
    saga_block_adam_update(&features, &adam, number);
    return true;
}
