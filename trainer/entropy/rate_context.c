/* SPDX-License-Identifier: MIT */
#include "rate_context.h"

#include "alloc.h"
#include "arena.h"

#include <stdlib.h>
#include <string.h>

/* --- Memory -------------------------------------------------------------- */

static void lay_out(saga_rate_context *c, saga_arena *a, const saga_scene *s)
{
    const size_t most = s->n.fine > s->n.coarse ? s->n.fine : s->n.coarse;
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_rate_kind *const k = &c->kind[kind];
        const size_t n = k->n_blocks;
        const size_t values = n * saga_n_channels(&s->model, kind);

        k->phase = saga_arena_take(a, 4 * n);
        k->size = saga_arena_take(a, SAGA_RATE_SIZES * n);
        k->mu = saga_arena_take(a, values);
        k->d_mu = saga_arena_take(a, values);
        k->log2_sigma = saga_arena_take(a, values);
        k->d_log2_sigma = saga_arena_take(a, values);
        saga_twin_batch_take(&k->net, a, &s->net[SAGA_NET_E_COARSE + kind], n);
        if (s->model.sources[kind] & SAGA_SOURCE_HYPER)
            saga_twin_batch_take(&k->hyper, a, &s->net[SAGA_NET_HYPER], n);
    }
    c->scratch = saga_arena_take(a, most * s->model.features);
}

static bool alloc_kind(saga_rate_kind *k, const saga_scene *s, int kind,
                       saga_error *error)
{
    const saga_net *const net = &s->net[SAGA_NET_E_COARSE + kind];
    const saga_net *const hyper = &s->net[SAGA_NET_HYPER];
    const size_t n = saga_rate_n_blocks(s, kind);

    k->n_blocks = n;
    return saga_rate_runs_alloc(&k->runs, s, kind, error) &&
           saga_links_alloc(&k->parent, n, error) &&
           saga_links_alloc(&k->groups, n, error) &&
           (net->n_layers == 0 ||
            saga_net_reserve(&k->net.work, net, n, error)) &&
           (!(s->model.sources[kind] & SAGA_SOURCE_HYPER) ||
            saga_net_reserve(&k->hyper.work, hyper, n, error));
}

bool saga_rate_context_init(saga_rate_context *c, const saga_scene *s,
                            saga_error *error)
{
    saga_arena a = { NULL, 0 };
    bool ok = true;
    int kind;

    memset(c, 0, sizeof *c);
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        c->keep[kind] = UINT8_MAX;
        ok = ok && alloc_kind(&c->kind[kind], s, kind, error);
    }
    ok = ok && saga_bank_twin_init(&c->bank, s, error);
    lay_out(c, &a, s);
    if (ok)
        c->block = saga_arena_alloc(&a, "the entropy model", error);
    if (!c->block) {
        saga_rate_context_free(c);
        return false;
    }
    lay_out(c, &a, s);
    return true;
}

void saga_rate_context_free(saga_rate_context *c)
{
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_rate_kind *const k = &c->kind[kind];

        saga_rate_runs_free(&k->runs);
        saga_links_free(&k->parent);
        saga_links_free(&k->groups);
        saga_net_free(&k->hyper.work);
        saga_net_free(&k->net.work);
    }
    saga_bank_twin_free(&c->bank);
    free(c->block);
    memset(c, 0, sizeof *c);
}

/* --- Positions and neighbours -------------------------------------------- */

/* Sets sizes as in_side of common/context.c does: log2 half-sizes in units, and
 * count / 8. */
static void set_size(real size[SAGA_RATE_SIZES], const real log2_units[4],
                     uint32_t count)
{
    int i;

    /* The integers are Q10 and passed on as Q12, a fourth of their value. 0
     * stands for a half-size of 2^12 box units or 2^8 time units. */
    for (i = 0; i < 4; i++)
        size[i] = (log2_units[i] - (i < 3 ? 12 : 8)) / 4;
    size[4] = R(count) / 8;
}

static void keep_position(saga_rate_kind *k, size_t i, const saga_position *p,
                          uint32_t count)
{
    real log2_units[4];
    size_t a;

    /* Positions are scaled to -1..1 on each axis. */
    for (a = 0; a < 3; a++)
        k->phase[4 * i + a] = R(p->x[a]) / 8388608;
    k->phase[4 * i + 3] = R(p->t) / 32768 - 1;
    for (a = 0; a < 4; a++)
        log2_units[a] = R(p->log2_support_q10[a]) / 1024;
    set_size(k->size + SAGA_RATE_SIZES * i, log2_units, count);
}

static void refresh_coarse(saga_rate_kind *k, const saga_scaffold *sc,
                           const saga_scene *s)
{
    saga_neighbours nb;
    saga_position p;
    uint32_t i;

    k->groups.n = 0;
    for (i = 0; i < sc->n.coarse; i++) {
        const saga_links_query q = { SAGA_TIER_COARSE, &p, i,
                                     sc->coarse[i].group };

        saga_position_cell(&p, &sc->coarse[i]);
        keep_position(k, i, &p, sc->coarse[i].n_fine);
        saga_links_find(&nb, sc, s, &q);
        saga_links_add(&k->groups, i, &nb);
    }
}

/* Sets positions and neighbours of fine anchors. Distances to neighbours are in
 * the parent's half-sizes; the hyperprior reads the half-sizes of the suffix
 * cell (saga_context_run). */
static void refresh_fine(saga_rate_kind *k, const saga_scaffold *sc,
                         const saga_scene *s)
{
    const int bits = sc->model->tier[SAGA_TIER_COARSE].suffix_bits;
    saga_neighbours nb;
    saga_position p;
    uint32_t i;
    int a;

    k->parent.n = k->groups.n = 0;
    for (i = 0; i < sc->n.fine; i++) {
        const saga_fine *const f = &sc->fine[i];
        const saga_coarse *const parent = &sc->coarse[f->parent];
        const saga_links_query of_parent = { SAGA_TIER_COARSE, &p, f->parent,
                                             SAGA_ALL_GROUPS };
        const saga_links_query of_groups = { SAGA_TIER_FINE, &p, i, f->group };

        saga_position_cell(&p, parent);
        saga_position_move(&p, f->local);
        /* A suffix cell is 2^bits times smaller than its parent's cell. */
        for (a = 0; a < 4; a++)
            p.log2_support_q10[a] -= bits * 1024;
        keep_position(k, i, &p, parent->n_fine);
        saga_links_find(&nb, sc, s, &of_parent);
        saga_links_add(&k->parent, i, &nb);
        saga_links_find(&nb, sc, s, &of_groups);
        saga_links_add(&k->groups, i, &nb);
    }
}

void saga_rate_place_prims(saga_rate_kind *k, const saga_scene *s,
                           const saga_twin *w, const uint32_t *block, size_t n)
{
    size_t i, a;

    for (i = 0; i < n; i++) {
        const size_t b = block[i];
        real log2_units[4];

        for (a = 0; a < 4; a++)
            log2_units[a] = w->log2_support[4 * b + a] + (a < 3 ? 23 : 16);
        memcpy(k->phase + 4 * b, w->fine_phase + 4 * b, 4 * sizeof *k->phase);
        set_size(k->size + SAGA_RATE_SIZES * b, log2_units, s->fine[b].n_prim);
    }
}

bool saga_rate_context_refresh(saga_rate_context *c, const saga_scene *s,
                               saga_error *error)
{
    saga_scaffold sc;
    int kind;

    if (!saga_links_scaffold(&sc, s, error))
        return false;
    for (kind = 0; kind < SAGA_N_KINDS; kind++)
        saga_rate_runs_set(&c->kind[kind].runs, s, kind);
    refresh_coarse(&c->kind[SAGA_KIND_COARSE], &sc, s);
    refresh_fine(&c->kind[SAGA_KIND_FINE], &sc, s);
    saga_links_scaffold_free(&sc);
    return true;
}

/* --- Formats and sources ------------------------------------------------- */

int saga_rate_step_of(int kind, size_t channel)
{
    return kind == SAGA_KIND_FINE   ? SAGA_STEP_FINE
           : kind == SAGA_KIND_PRIM ? SAGA_STEP_PRIM
           : channel < 4            ? SAGA_STEP_CENTRE
                                    : SAGA_STEP_FEATURE;
}

int saga_rate_value_q(const saga_model *m, int kind, size_t channel)
{
    return saga_rate_step_of(kind, channel) == SAGA_STEP_FEATURE
               ? m->out_q[SAGA_OUT_COARSE]
               : 14;
}

int saga_rate_mu_q(const saga_model *m, int kind, size_t channel)
{
    uint32_t step = m->step_q16[saga_rate_step_of(kind, channel)] >> 16;
    int q = 0;

    /* q is floor(log2(step)), with the step in units of the value's format. */
    while (step >>= 1)
        q++;
    return q;
}

real saga_rate_mu_unit(const saga_model *m, int kind, size_t channel)
{
    const int q = saga_rate_value_q(m, kind, channel) -
                  saga_rate_mu_q(m, kind, channel);

    return q < 0 ? R(1 << -q) : 1 / R(1 << q);
}

uint32_t saga_rate_sources(const saga_rate_context *c, const saga_scene *s,
                           int kind)
{
    return (uint32_t)s->model.sources[kind] & c->keep[kind];
}

size_t saga_rate_columns(const saga_model *m, uint32_t source)
{
    return source == SAGA_SOURCE_BANK ? m->bank_width : m->features;
}

/* --- The bank ------------------------------------------------------------ */

uint32_t saga_rate_readers(const saga_rate_context *c, const saga_scene *s)
{
    uint32_t readers = 0;
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++)
        if (saga_rate_sources(c, s, kind) & SAGA_SOURCE_BANK)
            readers |= 1u << kind;
    return readers;
}

static saga_bank_twin_input bank_input(const saga_rate_context *c,
                                       const saga_scene *s, int kind,
                                       const saga_rate_features *x)
{
    const saga_rate_kind *const k = &c->kind[kind];
    saga_bank_twin_input in = { s, kind, &k->runs, 0, k->phase, k->size, *x };
    int i;

    /* States are in the order of coding, after those of all earlier kinds. */
    for (i = 0; i < kind; i++)
        in.first += c->kind[i].runs.n;
    return in;
}

void saga_rate_context_begin(saga_rate_context *c, const saga_scene *s)
{
    if (saga_rate_readers(c, s))
        saga_bank_twin_begin(&c->bank, s);
}

void saga_rate_context_read(saga_rate_context *c, const saga_scene *s, int kind,
                            size_t from, size_t to, const saga_rate_features *x)
{
    const saga_bank_twin_input in = bank_input(c, s, kind, x);
    const uint32_t begin = in.runs->begin[from];
    const saga_rate_list list = { in.runs->block + begin,
                                  in.runs->begin[to] - begin };

    if (!(saga_rate_readers(c, s) >> kind & 1u))
        return;
    if (kind == SAGA_KIND_PRIM)
        saga_rate_place_prims(&c->kind[kind], s, x->twin, list.block, list.n);
    saga_bank_twin_read(&c->bank, &in, from, to);
}

void saga_rate_context_write(saga_rate_context *c, const saga_scene *s,
                             int kind, size_t from, size_t to,
                             const saga_rate_features *x)
{
    const saga_bank_twin_input in = bank_input(c, s, kind, x);

    if (kind != SAGA_KIND_PRIM && saga_rate_readers(c, s) >> kind)
        saga_bank_twin_write(&c->bank, &in, from, to);
}

void saga_rate_context_remember(saga_rate_context *c, const saga_scene *s,
                                const saga_rate_features *x)
{
    int kind;

    saga_rate_context_begin(c, s);
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const size_t n = c->kind[kind].n_blocks * c->bank.width;

        saga_rate_context_write(c, s, kind, 0, c->kind[kind].runs.n, x);
        saga_rate_context_read(c, s, kind, 0, c->kind[kind].runs.n, x);
        /* The evaluation sets d_read for its blocks only; the others have no
         * gradient. */
        memset(c->bank.kind[kind].d_read, 0, n * sizeof(real));
    }
}

void saga_rate_context_remember_backward(saga_rate_context *c, saga_scene *d,
                                         const saga_scene *s,
                                         const saga_rate_features *x,
                                         const saga_rate_features *dx)
{
    const uint32_t readers = saga_rate_readers(c, s);
    int kind;

    saga_bank_twin_clear(&c->bank, s);
    for (kind = SAGA_N_KINDS - 1; kind >= 0; kind--) {
        const saga_bank_twin_input in = bank_input(c, s, kind, x);

        /* A tier that reads nothing may have written for later kinds. */
        if (readers >> kind)
            saga_bank_twin_backward(&c->bank, d, dx, &in, readers >> kind & 1u);
    }
    saga_bank_twin_end(&c->bank, d, s);
}
