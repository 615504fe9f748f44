/* SPDX-License-Identifier: MIT */
#include "away_rate.h"

#include "alloc.h"
#include "fit_away.h"
#include "rate_values.h"
#include "rng.h"

#include <float.h>
#include <stdlib.h>
#include <string.h>

static const char what[] = "the rate of anchors";

/* --- Kinds --------------------------------------------------------------- */

static void set_scale(saga_away_channels *c, const saga_model *m, int kind,
                      bool has_network)
{
    for (size_t i = 0; i < saga_n_channels(m, kind); i++) {
        real *const scale = c->scale[i];

        /* Constants are in the value's unit, and not clamped. */
        scale[0] = has_network ? saga_rate_mu_unit(m, kind, i) : 1;
        scale[1] = has_network ? saga_rate_most(saga_rate_value_q(m, kind, i))
                               : FLT_MAX;
        if (saga_rate_is_anchor(kind, i))
            scale[0] = scale[1] = 0;
        scale[2] = R(saga_rate_step_size(m, kind, i));
    }
}

/* Makes a network without inputs of a kind's constants. */
static void set_constants(saga_away_channels *c, const saga_rate *r, size_t n,
                          int kind)
{
    const saga_net net = { .n_layers = 1, .dim = { 0, 2 * (int)n } };

    for (size_t i = 0; i < n; i++) {
        c->biases[i] = r->constants.mean[kind][i];
        c->biases[n + i] = r->constants.log2_sigma[kind][i];
    }
    c->constants = c->d_constants = net;
    saga_net_bind(&c->constants, c->biases);
    saga_net_bind(&c->d_constants, c->d_biases);
}

static saga_gpu_rate_kind kind_of(saga_away_channels *c, const saga_rate *r,
                                  const saga_scene *s, saga_scene *d, int kind)
{
    const saga_model *const m = &s->model;
    const int net = SAGA_NET_E_COARSE + kind;
    const size_t n = saga_n_channels(m, kind);
    saga_gpu_rate_kind k = {
        .net = &s->net[net],
        .hyper = &s->net[SAGA_NET_HYPER],
        .d_net = &d->net[net],
        .d_hyper = &d->net[SAGA_NET_HYPER],
        .sources = m->sources[kind],
        .keep = r->context.keep[kind],
        .scale = c->scale[0],
        .mu_scale = R(1 << saga_rate_value_q(m, kind, n - 1)),
        .most = saga_rate_most(m->q_in[net]),
        .hyper_most = saga_rate_most(m->q_in[SAGA_NET_HYPER]),
        .read_most = saga_rate_most(m->out_q[SAGA_OUT_HYPER])
    };
    const bool has_network = saga_rate_sources(&r->context, s, kind) != 0;

    set_scale(c, m, kind, has_network);
    /* A kind without sources has a network of constants in place of its own. */
    if (!has_network) {
        set_constants(c, r, n, kind);
        k.net = &c->constants;
        k.d_net = &c->d_constants;
    }
    return k;
}

/* Returns where parameters begin: behind those of primitives and F_fine. */
static uint32_t first_param(const saga_scene *s)
{
    return saga_away_n_params(s) +
           (uint32_t)saga_net_n_params(&s->net[SAGA_NET_FINE]);
}

/* Sets all but how an iteration looks at blocks. */
static void set_kinds(saga_away_rates *a, const saga_rate *r,
                      const saga_scene *s, saga_scene *d)
{
    memset(a->kind, 0, sizeof a->kind);
    a->to = (saga_gpu_rates){ .n = s->n.coarse,
                              .every = 1,
                              .features = s->model.features,
                              .octaves = s->model.octaves,
                              .base = first_param(s) };
    for (int kind = 0; kind < SAGA_N_KINDS; kind++) {
        a->to.kind[kind] = kind_of(&a->kind[kind], r, s, d, kind);
        a->to.bits[kind] = a->kind[kind].bits;
    }
}

bool saga_away_has_own(const saga_scene *s)
{
    bool own = s->n.coarse == s->n.fine && s->n.fine == s->n.prim;

    for (uint32_t i = 0; i < s->n.prim && own; i++)
        own = s->prim_fine[i] == i && s->fine[i].parent == i;
    return own;
}

bool saga_away_can_rate(const saga_gpu *gpu, const saga_rate *r,
                        const saga_scene *s)
{
    saga_scene d = *s;
    saga_away_rates a;

    set_kinds(&a, r, s, &d);
    return saga_gpu_can_rate(gpu, &a.to);
}

/* --- What stays ---------------------------------------------------------- */

static saga_gpu_links links_of(const saga_links *l)
{
    return (saga_gpu_links){ .begin = l->n ? l->begin : NULL,
                             .rank = l->rank,
                             .weight = l->weight };
}

/* Sets what the host has in other forms: span (n) of coded features, offset
 * (n, 4) of fine anchors, and phase (n, 4) of primitives' places. */
static void set_places(uint32_t *span, real *offset, real *phase,
                       const saga_rate *r, const saga_scene *s)
{
    for (size_t i = 0; i < s->n.coarse; i++) {
        const saga_class has = saga_scene_class(s, i);

        /* Two bytes, as rate_cost.comp reads them. */
        span[i] = has.first + 256u * has.n;
        for (size_t k = 0; k < 4; k++)
            offset[4 * i + k] = r->offset[SAGA_RATE_OFFSETS * i + k];
        saga_scene_phase(phase + 4 * i, s->fine_x + 4 * i);
    }
}

bool saga_away_put_rate(saga_gpu_canvas *g, const saga_rate *r,
                        const saga_scene *s, saga_error *error)
{
    const size_t n = s->n.coarse;
    const saga_rate_kind *const kind = r->context.kind;
    const saga_rate_kind *const coarse = &kind[SAGA_KIND_COARSE];
    const saga_rate_kind *const fine = &kind[SAGA_KIND_FINE];
    uint32_t *const span = saga_calloc(n, sizeof *span, what, error);
    real *const offset = saga_calloc(n, 8 * sizeof *offset, what, error);
    real *const phase = offset ? offset + 4 * n : NULL;
    const saga_gpu_rate_scene to = {
        .n = s->n.coarse,
        .span = span,
        .fine_offset = r->offset,
        .value = { r->centre, offset },
        .phase = { coarse->phase, fine->phase, phase },
        .size = { coarse->size, fine->size },
        .links = { [SAGA_GPU_COARSE_GROUPS] = links_of(&coarse->groups),
                   [SAGA_GPU_FINE_GROUPS] = links_of(&fine->groups),
                   [SAGA_GPU_FINE_PARENT] = links_of(&fine->parent) }
    };
    bool ok = span && offset;

    /* Positions of primitives and their sizes change, so they are not here. */
    if (ok)
        set_places(span, offset, phase, r, s);
    ok = ok && saga_gpu_put_rates(g, &to, error);
    free(span);
    free(offset);
    return ok;
}

/* --- An iteration -------------------------------------------------------- */

void saga_away_list_rates(saga_away_rates *a, saga_rate *r, saga_scene *d,
                          const saga_scene *s, const saga_rate_options *o)
{
    a->rounded = saga_rate_rounded(r, s);
    set_kinds(a, r, &a->rounded, d);
    a->to.first = o->first;
    a->to.every = o->every;
    a->to.rounding = o->rounding;
    a->to.weight = o->weight * R(o->every);
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        a->to.kind[kind].key = saga_rng_stream(o->seed, (uint64_t)kind).key;
}

void saga_away_bits(double bits[SAGA_N_STEPS], const saga_away_rates *a)
{
    const saga_model *const m = &a->rounded.model;

    memset(bits, 0, SAGA_N_STEPS * sizeof *bits);
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        for (size_t c = 0; c < saga_n_channels(m, kind); c++)
            bits[saga_rate_step_of(kind, c)] += a->to.every *
                                                (double)a->kind[kind].bits[c];
}
