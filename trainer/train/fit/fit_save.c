/* SPDX-License-Identifier: MIT
 *
 * The checkpoint holds what the next iteration reads and cannot compute. Random
 * numbers have no state, and the structure follows from the warm-up. Four
 * things of the twin are kept: links, which stay the same between refreshes;
 * supports, in which the next offsets are computed; offsets, because layers are
 * rounded before their iteration computes new ones; and for the same reason
 * phases, if there is a Fuse network, which alone reads them that early.
 */
#include "fit_state.h"

static void walk_reals(saga_checkpoint *c, real *x, size_t n)
{
    saga_checkpoint_walk(c, x, n * sizeof *x);
}

static void walk_links(saga_checkpoint *c, saga_links *l, size_t queries)
{
    uint64_t n = l->n;

    saga_checkpoint_walk(c, &n, sizeof n);
    /* A damaged count must not exceed the arrays. */
    c->failed = c->failed || n > queries * SAGA_MAX_NEIGHBOURS;
    if (c->failed)
        return;
    l->n = (size_t)n;
    saga_checkpoint_walk(c, l->begin, (queries + 1) * sizeof *l->begin);
    saga_checkpoint_walk(c, l->rank, l->n * sizeof *l->rank);
    walk_reals(c, l->weight, l->n);
}

static void walk_twin(saga_checkpoint *c, saga_twin *w, const saga_scene *s)
{
    walk_links(c, &w->to_fine, w->n.fine);
    walk_links(c, &w->to_prim, w->n.prim);
    if (c->reading && !c->failed)
        saga_twin_note_own(w, s);
    walk_reals(c, w->support, 4 * (size_t)w->n.fine);
    walk_reals(c, w->fine_offset, 4 * (size_t)w->n.fine);
    walk_reals(c, w->prim_offset, 4 * (size_t)w->n.prim);
    if (s->net[SAGA_NET_FUSE_C].n_layers)
        walk_reals(c, w->fine_phase, 4 * (size_t)w->n.fine);
    if (s->net[SAGA_NET_FUSE_F].n_layers)
        walk_reals(c, w->prim_phase, 4 * (size_t)w->n.prim);
}

/* Keeps the parts of the rate that change. Anchors do not move, so the rest
 * stays as it was made. The bank's reads are kept for the iterations until they
 * are evaluated again. */
static void walk_rate(saga_checkpoint *c, saga_rate *r, const saga_scene *s)
{
    saga_rate_context *const k = &r->context;

    walk_reals(c, r->mu_feature, (size_t)s->n.coarse * s->model.features);
    walk_reals(c, r->mu_offset, 4 * (size_t)s->n.fine);
    saga_checkpoint_walk(c, k->keep, sizeof k->keep);
    saga_checkpoint_walk(c, &r->decision, sizeof r->decision);
    saga_checkpoint_walk(c, &r->constants, sizeof r->constants);
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        walk_reals(c, k->bank.kind[kind].read,
                   k->kind[kind].n_blocks * k->bank.width);
}

/* The classes of anchors, which the start of the fit has chosen. */
static void walk_classes(saga_checkpoint *c, saga_scene *s)
{
    for (uint32_t i = 0; s->model.n_classes && i < s->n.coarse; i++) {
        saga_checkpoint_walk(c, &s->coarse[i].class, 1);
        c->failed = c->failed || s->coarse[i].class >= s->model.n_classes;
    }
}

void saga_fit_walk(saga_fit *f, saga_checkpoint *c)
{
    saga_weights *const w = &f->weights;
    uint64_t iteration = (uint64_t)f->iteration;

    /* The scene was rebuilt from the warm-up and must have the same sizes. */
    saga_checkpoint_expect(c, f->scene->n.coarse);
    saga_checkpoint_expect(c, f->scene->n.fine);
    saga_checkpoint_expect(c, f->scene->n.prim);
    saga_checkpoint_expect(c, f->scene->n_reals);
    saga_checkpoint_walk(c, &iteration, sizeof iteration);
    /* After its end, a fit is at the iteration one past the last. */
    c->failed = c->failed || iteration > (uint64_t)f->o.n_render;
    /* The step may have been steered (size.c), and the prices with it. */
    saga_fit_walk_step(f, c);
    walk_classes(c, f->scene);
    /* The parameters, and the state of their optimisers. */
    walk_reals(c, f->scene->reals, f->scene->n_reals);
    saga_fit_walk_descent(f, c);
    f->is_rated_away = f->is_rated_away && !c->reading;
    f->is_there = f->is_there && !c->reading;
    walk_rate(c, &f->rate, f->scene);
    /* The steps of the weights are kept. The copies with noise are made
     * again. */
    saga_checkpoint_walk(c, w->log2_step, sizeof w->log2_step);
    saga_checkpoint_walk(c, w->m, sizeof w->m);
    saga_checkpoint_walk(c, w->v, sizeof w->v);
    walk_twin(c, &f->twin, f->scene);
    f->iteration = (int)iteration;
}

double saga_fit_bits(const saga_fit *f)
{
    double sum = 0;

    for (int i = 0; i < SAGA_N_STEPS; i++)
        sum += f->bits[i];
    return sum;
}
