/* SPDX-License-Identifier: MIT */
#include "context.h"

#include "fx.h"
#include "interp.h"

/* Sizes and counts enter the hyperprior in Q12, scaled so that they fit the
 * default input range of +-8:
 *     (log2 l - 12) / 4 for space, (log2 l_t - 8) / 4 for time, count / 8.
 * (x / 4 in Q12 has the digits of x in Q10.) */
static void run_hyper(const saga_scaffold *sc, const saga_place *p,
                      uint32_t count)
{
    int16_t size[5];
    uint32_t at;
    int i;

    for (i = 0; i < 3; i++)
        size[i] = (int16_t)(p->log2_support_q10[i] - 12 * 1024);
    size[3] = (int16_t)(p->log2_support_q10[3] - 8 * 1024);
    size[4] = (int16_t)(count * 512u);
    at = saga_in_embed(sc, SAGA_NET_HYPER, 0, p->x, p->t);
    saga_in_vector(sc, SAGA_NET_HYPER, at, size, 5, 12);
    saga_net_run(sc, SAGA_NET_HYPER);
}

/* Where a block stands, and what there is around it. */
typedef struct {
    saga_place place;
    uint32_t count;          /* children, known before the block */
    uint32_t rank, group;
} block;

/* Neighbours of earlier groups of the block's own level. */
static void add_groups(const saga_scaffold *sc, const block *b, int level)
{
    saga_neighbours nb;

    saga_interp_find(&nb, sc, level, &b->place, b->rank, b->group);
    saga_interp_sum(sc->v->context, sc, level, &nb);
}

/* The parent's context: coarse features interpolated at the block (fine), or
 * the fine anchor's own features (primitives). Returns their Q. */
static int add_parent(const saga_scaffold *sc, const block *b, int kind)
{
    const uint32_t f = sc->model->features;
    saga_neighbours nb;
    uint32_t i;

    if (kind == SAGA_KIND_FINE) {
        saga_interp_find(&nb, sc, SAGA_LEVEL_COARSE, &b->place,
                         sc->fine[b->rank].parent, SAGA_ALL_GROUPS);
        saga_interp_sum(sc->v->context, sc, SAGA_LEVEL_COARSE, &nb);
        return sc->model->head_q[SAGA_HEAD_COARSE];
    }
    for (i = 0; i < f; i++)
        sc->v->context[i] = sc->fine_feature[(size_t)b->rank * f + i];
    return sc->model->head_q[SAGA_HEAD_FINE];
}

static void run_entropy(saga_params *p, const saga_scaffold *sc,
                        const block *b, int kind)
{
    const saga_model *const m = sc->model;
    const int net = SAGA_NET_E_COARSE + kind;
    const uint32_t sources = m->sources[kind];
    const uint32_t f = m->features, n = saga_n_channels(m, kind);
    uint32_t at = 0, i;
    int q;

    if (sources & SAGA_SOURCE_HYPER) {
        run_hyper(sc, &b->place, b->count);
        at = saga_in_vector(sc, net, at, sc->v->out, f,
                            m->head_q[SAGA_HEAD_HYPER]);
    }
    if (sources & SAGA_SOURCE_PARENT) {
        q = add_parent(sc, b, kind);
        at = saga_in_vector(sc, net, at, sc->v->context, f, q);
    }
    if (sources & SAGA_SOURCE_GROUPS) {
        add_groups(sc, b, kind);
        /* The coarse features' Q, or Q14 of fine residuals. */
        q = kind == SAGA_KIND_COARSE ? m->head_q[SAGA_HEAD_COARSE] : 14;
        at = saga_in_vector(sc, net, at, sc->v->context, f, q);
    }
    saga_net_run(sc, net);
    for (i = 0; i < n; i++) {
        p->mu[i] = sc->v->out[i];
        p->scale[i] = saga_prob_index(sc->v->out[n + i],
                                      m->head_q[SAGA_HEAD_SIGMA]);
    }
}

void saga_context_coarse(saga_params *p, const saga_scaffold *sc,
                         uint32_t rank, uint32_t group)
{
    block b;

    saga_place_cell(&b.place, &sc->coarse[rank]);
    b.count = sc->coarse[rank].n_fine;
    b.rank = rank;
    b.group = group;
    run_entropy(p, sc, &b, SAGA_KIND_COARSE);
}

void saga_context_fine(saga_params *p, const saga_scaffold *sc, uint32_t rank,
                       uint32_t group)
{
    const saga_fine *const fine = &sc->fine[rank];
    const saga_coarse *const parent = &sc->coarse[fine->parent];
    const int bits = sc->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    block b;
    int i;

    /* Centre: the suffix cell's. Support: the parent's, which is what the
     * distances use; size: the suffix cell's, which is what is new. */
    saga_place_cell(&b.place, parent);
    saga_place_move(&b.place, fine->local);
    for (i = 0; i < 4; i++)
        b.place.log2_support_q10[i] -= bits * 1024;
    b.count = parent->n_fine;
    b.rank = rank;
    b.group = group;
    run_entropy(p, sc, &b, SAGA_KIND_FINE);
}

void saga_context_prim(saga_params *p, const saga_scaffold *sc, uint32_t rank)
{
    block b;

    saga_place_fine(&b.place, &sc->fine[rank]);
    b.count = sc->fine[rank].n_prim;
    b.rank = rank;
    b.group = 0;
    run_entropy(p, sc, &b, SAGA_KIND_PRIM);
}
