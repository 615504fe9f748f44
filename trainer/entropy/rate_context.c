/* SPDX-License-Identifier: MIT */
#include "rate_context.h"

#include "alloc.h"
#include "arena.h"
#include "rate_bits.h"

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

/* Sets sizes as in_side of common/context.c does: log2 half-sizes in units,
 * count / 8. */
static void set_size(real size[SAGA_RATE_SIZES], const real log2_units[4],
                     uint32_t count)
{
    int i;

    for (i = 0; i < 4; i++)
        size[i] = (log2_units[i] - (i < 3 ? 12 : 8)) / 4;
    size[4] = R(count) / 8;
}

static void keep_position(saga_rate_kind *k, size_t i, const saga_position *p,
                       uint32_t count)
{
    real log2_units[4];
    size_t a;

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

/* The distances use the parent's half-sizes, the hyperprior the suffix cell's
 * (saga_context_run). */
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
        for (a = 0; a < 4; a++)
            p.log2_support_q10[a] -= bits * 1024;
        keep_position(k, i, &p, parent->n_fine);
        saga_links_find(&nb, sc, s, &of_parent);
        saga_links_add(&k->parent, i, &nb);
        saga_links_find(&nb, sc, s, &of_groups);
        saga_links_add(&k->groups, i, &nb);
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
    return kind == SAGA_KIND_FINE ? SAGA_STEP_FINE
         : kind == SAGA_KIND_PRIM ? SAGA_STEP_PRIM
         : channel < 4 ? SAGA_STEP_CENTRE : SAGA_STEP_FEATURE;
}

int saga_rate_value_q(const saga_model *m, int kind, size_t channel)
{
    return saga_rate_step_of(kind, channel) == SAGA_STEP_FEATURE
        ? m->head_q[SAGA_HEAD_COARSE] : 14;
}

int saga_rate_mu_q(const saga_model *m, int kind, size_t channel)
{
    uint32_t step = m->step_q16[saga_rate_step_of(kind, channel)] >> 16;
    int q = 0;

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

/* --- Forward ------------------------------------------------------------- */

/* A job is one evaluation. */
typedef struct {
    const saga_scene *s;
    saga_rate_kind *k;
    real *scratch;
    int kind, net;
    saga_rate_list list;
    size_t f, dim;           /* features; inputs of the network */
} job;

static job job_of(saga_rate_context *c, const saga_scene *s, int kind,
                  saga_rate_list list)
{
    const int net = SAGA_NET_E_COARSE + kind;
    const job j = {
        s, &c->kind[kind], c->scratch, kind, net, list, s->model.features,
        (size_t)s->net[net].dim[0]
    };

    return j;
}

static void copy_columns(real *to, size_t to_stride, const real *from,
                         size_t stride, size_t n_columns, size_t rows)
{
    size_t i;

    for (i = 0; i < rows; i++)
        memcpy(to + i * to_stride, from + i * stride, n_columns * sizeof *to);
}

/* A block of primitives has no position of its own; it uses its fine anchor's,
 * and its size. */
static void place_prims(saga_rate_kind *k, const saga_scene *s,
                        const saga_twin *w, saga_rate_list list)
{
    size_t i, a;

    for (i = 0; i < list.n; i++) {
        const size_t b = list.block[i];
        real log2_units[4];

        for (a = 0; a < 4; a++)
            log2_units[a] = w->log2_support[4 * b + a] + (a < 3 ? 23 : 16);
        memcpy(k->phase + 4 * b, w->fine_phase + 4 * b, 4 * sizeof *k->phase);
        set_size(k->size + SAGA_RATE_SIZES * b, log2_units, s->fine[b].n_prim);
    }
}

static void hyper_forward(const job *j)
{
    const saga_net *const net = &j->s->net[SAGA_NET_HYPER];
    const size_t dim = (size_t)net->dim[0];
    saga_twin_batch *const b = &j->k->hyper;
    size_t i;

    for (i = 0; i < j->list.n; i++) {
        const size_t block = j->list.block[i];

        saga_rate_tell(b->in + i * dim, &j->s->model, j->k->phase + 4 * block,
                       j->k->size + SAGA_RATE_SIZES * block);
    }
    saga_rate_clamp(b->in, j->list.n * dim,
                    j->s->model.q_in[SAGA_NET_HYPER]);
    saga_net_forward(b->out, &b->work, b->in, j->list.n, net);
    saga_rate_clamp(b->out, j->list.n * j->f,
                    j->s->model.head_q[SAGA_HEAD_HYPER]);
}

static void parent_forward(real *in, const job *j, const saga_rate_features *x)
{
    const size_t n = j->list.n;
    size_t i;

    if (j->kind == SAGA_KIND_FINE) {
        saga_links_gather(j->scratch, &j->k->parent, x->coarse, j->f,
                          j->list.block, n);
        copy_columns(in, j->dim, j->scratch, j->f, j->f, n);
        return;
    }
    for (i = 0; i < n; i++)
        memcpy(in + i * j->dim, x->fine + j->list.block[i] * j->f,
               j->f * sizeof *in);
}

static void groups_forward(real *in, const job *j, const saga_rate_features *x)
{
    const int is_coarse = j->kind == SAGA_KIND_COARSE;
    const size_t have = is_coarse ? j->f : SAGA_RATE_OFFSETS;
    size_t i;

    saga_links_gather(j->scratch, &j->k->groups,
                      is_coarse ? x->coarse : x->offset, have, j->list.block,
                      j->list.n);
    copy_columns(in, j->dim, j->scratch, have, have, j->list.n);
    for (i = 0; i < j->list.n; i++)
        memset(in + i * j->dim + have, 0, (j->f - have) * sizeof *in);
}

/* The network's output becomes mu and log2 sigma. */
static void take_parameters(const job *j)
{
    const saga_model *const m = &j->s->model;
    const size_t channels = saga_n_channels(m, j->kind);
    saga_rate_kind *const k = j->k;
    size_t i, c;

    for (i = 0; i < j->list.n; i++)
        for (c = 0; c < channels; c++) {
            const real *const out = k->net.out + 2 * channels * i + c;
            const real unit = saga_rate_mu_unit(m, j->kind, c);
            const real most = saga_rate_most(saga_rate_value_q(m, j->kind, c));

            k->mu[i * channels + c] = saga_rate_is_anchor(j->kind, c)
                ? 0 : saga_clamp(unit * out[0], -most, most);
            k->log2_sigma[i * channels + c] =
                saga_clamp(out[channels], R(SAGA_RATE_LOG2_MIN),
                           R(SAGA_RATE_LOG2_MAX));
        }
}

static void bank_forward(real *in, const job *j, const real *read)
{
    const size_t d = j->s->model.bank_width;
    size_t i;

    for (i = 0; i < j->list.n; i++)
        memcpy(in + i * j->dim, read + j->k->runs.index[j->list.block[i]] * d,
               d * sizeof *in);
}

/* Puts zeros into the columns of a source that is not kept. */
static void drop(real *in, const job *j, size_t columns)
{
    size_t i;

    for (i = 0; i < j->list.n; i++)
        memset(in + i * j->dim, 0, columns * sizeof *in);
}

size_t saga_rate_columns(const saga_model *m, uint32_t source)
{
    return source == SAGA_SOURCE_BANK ? m->bank_width : m->features;
}

/* Fills one source's columns. */
static void source_forward(real *in, saga_rate_context *c, const job *j,
                           uint32_t source, const saga_rate_features *x)
{
    if (source == SAGA_SOURCE_HYPER) {
        hyper_forward(j);
        copy_columns(in, j->dim, j->k->hyper.out, j->f, j->f, j->list.n);
    } else if (source == SAGA_SOURCE_PARENT) {
        parent_forward(in, j, x);
    } else if (source == SAGA_SOURCE_GROUPS) {
        groups_forward(in, j, x);
    } else {
        bank_forward(in, j, c->bank.kind[j->kind].read);
    }
}

void saga_rate_context_forward(saga_rate_context *c, const saga_scene *s,
                               int kind, saga_rate_list list,
                               const saga_rate_features *x)
{
    const job j = job_of(c, s, kind, list);
    const uint32_t have = s->model.sources[kind];
    saga_twin_batch *const b = &j.k->net;
    real *in = b->in;
    uint32_t source;

    if (kind == SAGA_KIND_PRIM)
        place_prims(j.k, s, x->twin, list);
    for (source = 1; source < SAGA_SOURCES_KNOWN; source <<= 1) {
        const size_t columns = saga_rate_columns(&s->model, source);

        if (!(have & source))
            continue;
        if (!(c->keep[kind] & source))
            drop(in, &j, columns);
        else
            source_forward(in, c, &j, source, x);
        in += columns;
    }
    saga_rate_clamp(b->in, list.n * j.dim, s->model.q_in[j.net]);
    saga_net_forward(b->out, &b->work, b->in, list.n, &s->net[j.net]);
    take_parameters(&j);
}

/* --- Backward ------------------------------------------------------------ */

static void parameters_backward(const job *j)
{
    const saga_model *const m = &j->s->model;
    const size_t channels = saga_n_channels(m, j->kind);
    saga_rate_kind *const k = j->k;
    size_t i, c;

    for (i = 0; i < j->list.n; i++)
        for (c = 0; c < channels; c++) {
            const size_t at = i * channels + c;
            const real unit = saga_rate_mu_unit(m, j->kind, c);
            const real most = saga_rate_most(saga_rate_value_q(m, j->kind, c));
            real *const d = k->net.d_out + 2 * channels * i + c;

            d[0] = saga_rate_is_anchor(j->kind, c) ? 0
                 : unit * saga_inward(k->d_mu[at], k->mu[at], -most, most);
            d[channels] = saga_inward(k->d_log2_sigma[at],
                                           k->log2_sigma[at],
                                           R(SAGA_RATE_LOG2_MIN),
                                           R(SAGA_RATE_LOG2_MAX));
        }
}

static void hyper_backward(saga_scene *d, const job *j, const real *d_in)
{
    saga_twin_batch *const b = &j->k->hyper;
    const size_t n = j->list.n;

    copy_columns(b->d_out, j->f, d_in, j->dim, j->f, n);
    saga_rate_through(b->d_out, b->out, n * j->f,
                      j->s->model.head_q[SAGA_HEAD_HYPER]);
    saga_net_backward(NULL, &d->net[SAGA_NET_HYPER], &b->work, b->d_out, b->in,
                      n, &j->s->net[SAGA_NET_HYPER]);
}

static void parent_backward(const saga_rate_features *dx, const job *j,
                            const real *d_in)
{
    const size_t f = j->f;
    size_t i, k;

    if (j->kind == SAGA_KIND_FINE) {
        copy_columns(j->scratch, f, d_in, j->dim, f, j->list.n);
        saga_links_scatter(dx->coarse, &j->k->parent, j->scratch, f,
                           j->list.block, j->list.n);
        return;
    }
    for (i = 0; i < j->list.n; i++)
        for (k = 0; k < f; k++)
            dx->fine[j->list.block[i] * f + k] += d_in[i * j->dim + k];
}

/* Fine anchors' offsets, which they read of one another, learn nothing. */
static void groups_backward(const saga_rate_features *dx, const job *j,
                            const real *d_in)
{
    if (j->kind != SAGA_KIND_COARSE)
        return;
    copy_columns(j->scratch, j->f, d_in, j->dim, j->f, j->list.n);
    saga_links_scatter(dx->coarse, &j->k->groups, j->scratch, j->f,
                       j->list.block, j->list.n);
}

static void bank_backward(real *d_read, const job *j, const real *d_in)
{
    const size_t d = j->s->model.bank_width;
    size_t i;

    for (i = 0; i < j->list.n; i++)
        memcpy(d_read + j->k->runs.index[j->list.block[i]] * d,
               d_in + i * j->dim, d * sizeof *d_read);
}

static void source_backward(saga_rate_context *c, saga_scene *d,
                            const saga_rate_features *dx, const job *j,
                            uint32_t source, const real *d_in)
{
    if (source == SAGA_SOURCE_HYPER)
        hyper_backward(d, j, d_in);
    else if (source == SAGA_SOURCE_PARENT)
        parent_backward(dx, j, d_in);
    else if (source == SAGA_SOURCE_GROUPS)
        groups_backward(dx, j, d_in);
    else
        bank_backward(c->bank.kind[j->kind].d_read, j, d_in);
}

void saga_rate_context_backward(saga_rate_context *c, saga_scene *d,
                                const saga_scene *s, int kind,
                                saga_rate_list list,
                                const saga_rate_features *dx)
{
    const job j = job_of(c, s, kind, list);
    const uint32_t have = s->model.sources[kind];
    saga_twin_batch *const b = &j.k->net;
    const real *d_in = b->d_in;
    uint32_t source;

    parameters_backward(&j);
    saga_net_backward(b->d_in, &d->net[j.net], &b->work, b->d_out, b->in,
                      list.n, &s->net[j.net]);
    saga_rate_through(b->d_in, b->in, list.n * j.dim, s->model.q_in[j.net]);
    for (source = 1; source < SAGA_SOURCES_KNOWN; source <<= 1) {
        if (!(have & source))
            continue;
        if (c->keep[kind] & source)
            source_backward(c, d, dx, &j, source, d_in);
        d_in += saga_rate_columns(&s->model, source);
    }
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
    saga_bank_twin_input in = { s, kind, &k->runs, 0, k->phase, k->size,
                                  *x };
    int i;

    for (i = 0; i < kind; i++)
        in.first += c->kind[i].runs.n;
    return in;
}

void saga_rate_context_begin(saga_rate_context *c, const saga_scene *s)
{
    if (saga_rate_readers(c, s))
        saga_bank_twin_begin(&c->bank, s);
}

void saga_rate_context_read(saga_rate_context *c, const saga_scene *s,
                            int kind, size_t from, size_t to,
                            const saga_rate_features *x)
{
    const saga_bank_twin_input in = bank_input(c, s, kind, x);
    const uint32_t begin = in.runs->begin[from];
    const saga_rate_list list = { in.runs->block + begin,
                                  in.runs->begin[to] - begin };

    if (!(saga_rate_readers(c, s) >> kind & 1u))
        return;
    if (kind == SAGA_KIND_PRIM)
        place_prims(&c->kind[kind], s, x->twin, list);
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

        if (readers >> kind)
            saga_bank_twin_backward(&c->bank, d, dx, &in,
                                    readers >> kind & 1u);
    }
    saga_bank_twin_end(&c->bank, d, s);
}
