/* SPDX-License-Identifier: MIT */
#include "rate_context.h"

#include "arena.h"
#include "embedding.h"
#include "rate_bits.h"

#include <stdlib.h>
#include <string.h>

/* --- Memory -------------------------------------------------------------- */

static size_t blocks_of(const saga_scene *s, int kind)
{
    return kind == SAGA_KIND_COARSE ? s->n.coarse : s->n.fine;
}

static void lay_batch(saga_twin_batch *b, saga_arena *a, const saga_net *net,
                      size_t rows)
{
    b->in = saga_arena_take(a, rows * (size_t)net->dim[0]);
    b->d_in = saga_arena_take(a, rows * (size_t)net->dim[0]);
    b->out = saga_arena_take(a, rows * (size_t)net->dim[net->n_layers]);
    b->d_out = saga_arena_take(a, rows * (size_t)net->dim[net->n_layers]);
}

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
        lay_batch(&k->net, a, &s->net[SAGA_NET_E_COARSE + kind], n);
        if (s->model.sources[kind] & SAGA_SOURCE_HYPER)
            lay_batch(&k->hyper, a, &s->net[SAGA_NET_HYPER], n);
    }
    c->scratch = saga_arena_take(a, most * s->model.features);
}

int saga_rate_context_init(saga_rate_context *c, const saga_scene *s)
{
    saga_arena a = { NULL, 0 };
    int kind, ok = 1;

    memset(c, 0, sizeof *c);
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_rate_kind *const k = &c->kind[kind];

        c->keep[kind] = UINT8_MAX;
        k->n_blocks = blocks_of(s, kind);
        ok = ok && !saga_links_alloc(&k->parent, k->n_blocks) &&
             !saga_links_alloc(&k->groups, k->n_blocks);
    }
    lay_out(c, &a, s);
    c->block = calloc(a.n + 1, sizeof *c->block);
    if (!ok || !c->block) {
        saga_rate_context_free(c);
        return -1;
    }
    a.base = c->block;
    a.n = 0;
    lay_out(c, &a, s);
    return 0;
}

void saga_rate_context_free(saga_rate_context *c)
{
    int kind;

    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        saga_rate_kind *const k = &c->kind[kind];

        saga_links_free(&k->parent);
        saga_links_free(&k->groups);
        saga_net_free(&k->hyper.work);
        saga_net_free(&k->net.work);
    }
    free(c->block);
    memset(c, 0, sizeof *c);
}

/* --- Places and neighbours ----------------------------------------------- */

/* As run_hyper of common/context.c: log2 half-sizes in units, count / 8. */
static void set_size(real size[SAGA_RATE_SIZES], const real log2_units[4],
                     uint32_t count)
{
    int i;

    for (i = 0; i < 4; i++)
        size[i] = (log2_units[i] - (i < 3 ? 12 : 8)) / 4;
    size[4] = R(count) / 8;
}

static void keep_place(saga_rate_kind *k, size_t i, const saga_place *p,
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

static void refresh_coarse(saga_rate_kind *k, const saga_scaffold *sc)
{
    saga_neighbours nb;
    saga_place p;
    uint32_t i;

    k->groups.n = 0;
    for (i = 0; i < sc->n.coarse; i++) {
        saga_place_cell(&p, &sc->coarse[i]);
        keep_place(k, i, &p, sc->coarse[i].n_fine);
        saga_interp_find(&nb, sc, SAGA_LEVEL_COARSE, &p, i,
                         sc->coarse[i].group);
        saga_links_add(&k->groups, i, &nb);
    }
}

/* The distances use the parent's half-sizes, the hyperprior the suffix cell's
 * (saga_context_fine). */
static void refresh_fine(saga_rate_kind *k, const saga_scaffold *sc)
{
    const int bits = sc->model->level[SAGA_LEVEL_COARSE].suffix_bits;
    saga_neighbours nb;
    saga_place p;
    uint32_t i;
    int a;

    k->parent.n = k->groups.n = 0;
    for (i = 0; i < sc->n.fine; i++) {
        const saga_fine *const f = &sc->fine[i];
        const saga_coarse *const parent = &sc->coarse[f->parent];

        saga_place_cell(&p, parent);
        saga_place_move(&p, f->local);
        for (a = 0; a < 4; a++)
            p.log2_support_q10[a] -= bits * 1024;
        keep_place(k, i, &p, parent->n_fine);
        saga_interp_find(&nb, sc, SAGA_LEVEL_COARSE, &p, f->parent,
                         SAGA_ALL_GROUPS);
        saga_links_add(&k->parent, i, &nb);
        saga_interp_find(&nb, sc, SAGA_LEVEL_FINE, &p, i, f->group);
        saga_links_add(&k->groups, i, &nb);
    }
}

int saga_rate_context_refresh(saga_rate_context *c, const saga_scene *s)
{
    saga_scaffold sc;

    if (saga_links_scaffold(&sc, s))
        return -1;
    refresh_coarse(&c->kind[SAGA_KIND_COARSE], &sc);
    refresh_fine(&c->kind[SAGA_KIND_FINE], &sc);
    saga_links_scaffold_free(&sc);
    return 0;
}

/* --- Clamps of the integer path ------------------------------------------ */

static real clamp(real x, real lo, real hi)
{
    return x < lo ? lo : x > hi ? hi : x;
}

/* int16 in Q q. */
static real most_of(int q)
{
    return R(32767) / R(1 << q);
}

static void clamp_all(real *x, size_t n, int q)
{
    const real most = most_of(q);
    size_t i;

    for (i = 0; i < n; i++)
        x[i] = clamp(x[i], -most, most);
}

/* Gradients of what may have been clamped to lo..hi: towards the inside. */
static real through(real d, real x, real lo, real hi)
{
    return (x <= lo && d > 0) || (x >= hi && d < 0) ? 0 : d;
}

static void through_all(real *d, const real *x, size_t n, int q)
{
    const real most = most_of(q);
    size_t i;

    for (i = 0; i < n; i++)
        d[i] = through(d[i], x[i], -most, most);
}

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

/* One evaluation. */
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

/* One row of the hyperprior's input: embedding, sizes. */
static void hyper_row(real *row, const job *j, const saga_twin *w, size_t b)
{
    const saga_model *const m = &j->s->model;
    const size_t dim = (size_t)j->s->net[SAGA_NET_HYPER].dim[0];
    real *const size = row + saga_pe_size(m);
    const real *phase = j->k->phase + 4 * b;
    size_t a;

    if (j->kind == SAGA_KIND_PRIM) {
        real log2_units[4];

        phase = w->fine_phase + 4 * b;
        for (a = 0; a < 4; a++)
            log2_units[a] = w->log2_support[4 * b + a] + (a < 3 ? 23 : 16);
        set_size(size, log2_units, j->s->fine[b].n_prim);
    } else {
        memcpy(size, j->k->size + SAGA_RATE_SIZES * b,
               SAGA_RATE_SIZES * sizeof *row);
    }
    saga_embedding_forward(row, dim, phase, 1, 4, m->octaves);
    clamp_all(row, dim, m->q_in[SAGA_NET_HYPER]);
}

static int hyper_forward(const job *j, const saga_twin *w)
{
    const saga_net *const net = &j->s->net[SAGA_NET_HYPER];
    saga_twin_batch *const b = &j->k->hyper;
    size_t i;

    for (i = 0; i < j->list.n; i++)
        hyper_row(b->in + i * (size_t)net->dim[0], j, w, j->list.block[i]);
    if (saga_net_forward(b->out, &b->work, b->in, j->list.n, net))
        return -1;
    clamp_all(b->out, j->list.n * j->f, j->s->model.head_q[SAGA_HEAD_HYPER]);
    return 0;
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

/* The network's output to mu and log2 sigma. */
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
            const real most = most_of(saga_rate_value_q(m, j->kind, c));

            k->mu[i * channels + c] = saga_rate_is_anchor(j->kind, c)
                ? 0 : clamp(unit * out[0], -most, most);
            k->log2_sigma[i * channels + c] =
                clamp(out[channels], R(SAGA_RATE_LOG2_MIN),
                      R(SAGA_RATE_LOG2_MAX));
        }
}

/* Zeros in the columns of a source that is not kept; returns where the next
 * source's begin. */
static real *drop(real *in, const job *j)
{
    size_t i;

    for (i = 0; i < j->list.n; i++)
        memset(in + i * j->dim, 0, j->f * sizeof *in);
    return in + j->f;
}

int saga_rate_context_forward(saga_rate_context *c, const saga_scene *s,
                              const saga_twin *w, int kind,
                              saga_rate_list list, const saga_rate_features *x)
{
    const job j = job_of(c, s, kind, list);
    const uint32_t have = s->model.sources[kind], keep = c->keep[kind];
    saga_twin_batch *const b = &j.k->net;
    real *in = b->in;

    if (have & keep & SAGA_SOURCE_HYPER) {
        if (hyper_forward(&j, w))
            return -1;
        copy_columns(in, j.dim, j.k->hyper.out, j.f, j.f, list.n);
        in += j.f;
    } else if (have & SAGA_SOURCE_HYPER) {
        in = drop(in, &j);
    }
    if (have & keep & SAGA_SOURCE_PARENT) {
        parent_forward(in, &j, x);
        in += j.f;
    } else if (have & SAGA_SOURCE_PARENT) {
        in = drop(in, &j);
    }
    if (have & keep & SAGA_SOURCE_GROUPS)
        groups_forward(in, &j, x);
    else if (have & SAGA_SOURCE_GROUPS)
        drop(in, &j);
    clamp_all(b->in, list.n * j.dim, s->model.q_in[j.net]);
    if (saga_net_forward(b->out, &b->work, b->in, list.n, &s->net[j.net]))
        return -1;
    take_parameters(&j);
    return 0;
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
            const real most = most_of(saga_rate_value_q(m, j->kind, c));
            real *const d = k->net.d_out + 2 * channels * i + c;

            d[0] = saga_rate_is_anchor(j->kind, c)
                ? 0 : unit * through(k->d_mu[at], k->mu[at], -most, most);
            d[channels] = through(k->d_log2_sigma[at], k->log2_sigma[at],
                                  R(SAGA_RATE_LOG2_MIN),
                                  R(SAGA_RATE_LOG2_MAX));
        }
}

static int hyper_backward(saga_scene *d, const job *j, const real *d_in)
{
    saga_twin_batch *const b = &j->k->hyper;
    const size_t n = j->list.n;

    copy_columns(b->d_out, j->f, d_in, j->dim, j->f, n);
    through_all(b->d_out, b->out, n * j->f,
                j->s->model.head_q[SAGA_HEAD_HYPER]);
    return saga_net_backward(NULL, &d->net[SAGA_NET_HYPER], &b->work, b->d_out,
                             b->in, n, &j->s->net[SAGA_NET_HYPER]);
}

static void parent_backward(const saga_rate_features *dx, const job *j,
                            const real *d_in)
{
    const size_t f = j->f;
    size_t i, k;

    if (j->kind == SAGA_KIND_FINE && dx->coarse) {
        copy_columns(j->scratch, f, d_in, j->dim, f, j->list.n);
        saga_links_scatter(dx->coarse, &j->k->parent, j->scratch, f,
                           j->list.block, j->list.n);
    }
    if (j->kind == SAGA_KIND_PRIM && dx->fine)
        for (i = 0; i < j->list.n; i++)
            for (k = 0; k < f; k++)
                dx->fine[j->list.block[i] * f + k] += d_in[i * j->dim + k];
}

static void groups_backward(const saga_rate_features *dx, const job *j,
                            const real *d_in)
{
    const int is_coarse = j->kind == SAGA_KIND_COARSE;
    const size_t have = is_coarse ? j->f : SAGA_RATE_OFFSETS;
    real *const to = is_coarse ? dx->coarse : dx->offset;

    if (!to)
        return;
    copy_columns(j->scratch, have, d_in, j->dim, have, j->list.n);
    saga_links_scatter(to, &j->k->groups, j->scratch, have, j->list.block,
                       j->list.n);
}

int saga_rate_context_backward(saga_rate_context *c, saga_scene *d,
                               const saga_scene *s, int kind,
                               saga_rate_list list,
                               const saga_rate_features *dx)
{
    const job j = job_of(c, s, kind, list);
    const uint32_t have = s->model.sources[kind], keep = c->keep[kind];
    saga_twin_batch *const b = &j.k->net;
    const real *d_in = b->d_in;

    parameters_backward(&j);
    if (saga_net_backward(b->d_in, &d->net[j.net], &b->work, b->d_out, b->in,
                          list.n, &s->net[j.net]))
        return -1;
    through_all(b->d_in, b->in, list.n * j.dim, s->model.q_in[j.net]);
    if ((have & keep & SAGA_SOURCE_HYPER) && hyper_backward(d, &j, d_in))
        return -1;
    d_in += have & SAGA_SOURCE_HYPER ? j.f : 0;
    if (have & keep & SAGA_SOURCE_PARENT)
        parent_backward(dx, &j, d_in);
    d_in += have & SAGA_SOURCE_PARENT ? j.f : 0;
    if (have & keep & SAGA_SOURCE_GROUPS)
        groups_backward(dx, &j, d_in);
    return 0;
}
