/* SPDX-License-Identifier: MIT
 *
 * Computes entropy parameters of the listed blocks: forward from their sources
 * through the network of the kind, and backward to the values that the sources
 * read.
 */
#include "rate_context.h"

#include "rate_bits.h"
#include "threads.h"

#include <string.h>

/* --- Forward ------------------------------------------------------------- */

/* Threads take rows in chunks, as in the networks. ROW_NS is the time in
 * nanoseconds for everything in a row except the networks. */
enum { CHUNK = SAGA_NET_CHUNK, ROW_NS = 150 };

/* One evaluation; all chunks share it. */
typedef struct {
    saga_rate_context *c;
    saga_scene *d; /* gradients, for the backward pass */
    const saga_scene *s;
    const saga_rate_features *x, *dx;
    saga_rate_kind *k;
    int kind, net;
    saga_rate_list list;
    size_t f, dim; /* number of features, and of the network's
                    * inputs */
} job;

static job job_of(saga_rate_context *c, const saga_scene *s, int kind,
                  saga_rate_list list)
{
    const int net = SAGA_NET_E_COARSE + kind;
    const job j = { .c = c,
                    .s = s,
                    .k = &c->kind[kind],
                    .kind = kind,
                    .net = net,
                    .list = list,
                    .f = s->model.features,
                    .dim = (size_t)s->net[net].dim[0] };

    return j;
}

static saga_net_pass pass_of(const job *j)
{
    const saga_twin_batch *const b = &j->k->net;

    return (saga_net_pass){ .net = &j->s->net[j->net],
                            .work = &j->k->net.work,
                            .x = b->in,
                            .y = b->out,
                            .m = j->list.n };
}

static saga_net_pass hyper_pass_of(const job *j)
{
    const saga_twin_batch *const b = &j->k->hyper;

    return (saga_net_pass){ .net = &j->s->net[SAGA_NET_HYPER],
                            .work = &j->k->hyper.work,
                            .x = b->in,
                            .y = b->out,
                            .m = j->list.n,
                            .x_is_constant = true };
}

static bool has_hyper(const job *j)
{
    return j->s->model.sources[j->kind] & j->c->keep[j->kind] &
           SAGA_SOURCE_HYPER;
}

/* Returns the nanoseconds for a row and sets *most to the number of threads
 * that have scratch. */
static double cost_of(const job *j, size_t *most)
{
    *most = j->k->net.work.n_threads;
    return ROW_NS + saga_net_ns(&j->s->net[j->net]) +
           (has_hyper(j) ? saga_net_ns(&j->s->net[SAGA_NET_HYPER]) : 0);
}

static void copy_columns(real *to, size_t to_stride, const real *from,
                         size_t stride, size_t n_columns, saga_range rows)
{
    size_t i;

    for (i = rows.begin; i < rows.end; i++)
        saga_copy_row(to + i * to_stride, from + i * stride, n_columns);
}

static void hyper_forward(const job *j, saga_range of)
{
    const saga_net_pass p = hyper_pass_of(j);
    const size_t dim = (size_t)p.net->dim[0], n = of.end - of.begin;
    saga_twin_batch *const b = &j->k->hyper;
    size_t i;

    for (i = of.begin; i < of.end; i++) {
        const size_t block = j->list.block[i];

        saga_rate_inputs(b->in + i * dim, &j->s->model, j->k->phase + 4 * block,
                         j->k->size + SAGA_RATE_SIZES * block);
    }
    saga_rate_clamp(b->in + of.begin * dim, n * dim,
                    j->s->model.q_in[SAGA_NET_HYPER]);
    saga_net_chunk_forward(&p, of.begin / CHUNK);
    saga_rate_clamp(b->out + of.begin * j->f, n * j->f,
                    j->s->model.out_q[SAGA_OUT_HYPER]);
}

static void parent_forward(real *in, const job *j, saga_range of)
{
    real *const scratch = j->c->scratch;
    size_t i;

    if (j->kind == SAGA_KIND_FINE) {
        saga_links_gather(scratch, &j->k->parent, j->x->coarse, j->f,
                          j->list.block, of);
        copy_columns(in, j->dim, scratch, j->f, j->f, of);
        return;
    }
    /* Primitives read the features of their fine anchor. */
    for (i = of.begin; i < of.end; i++)
        saga_copy_row(in + i * j->dim, j->x->fine + j->list.block[i] * j->f,
                      j->f);
}

static void groups_forward(real *in, const job *j, saga_range of)
{
    const int is_coarse = j->kind == SAGA_KIND_COARSE;
    const size_t have = is_coarse ? j->f : SAGA_RATE_OFFSETS;
    /* Chunks have F reals for each of their rows; other threads use those of
     * others, also for sources with more columns. */
    real *const scratch = j->c->scratch + of.begin * (j->f - have);
    size_t i;

    saga_links_gather(scratch, &j->k->groups,
                      is_coarse ? j->x->coarse : j->x->offset, have,
                      j->list.block, of);
    copy_columns(in, j->dim, scratch, have, have, of);
    for (i = of.begin; i < of.end; i++)
        memset(in + i * j->dim + have, 0, (j->f - have) * sizeof *in);
}

/* The units and limits of mu in each channel; 0 where mu is 0. */
typedef struct {
    real unit[4 + SAGA_MAX_FEATURES], most[4 + SAGA_MAX_FEATURES];
} mu_scale;

static void scale_mu(mu_scale *s, const job *j, size_t channels)
{
    const saga_model *const m = &j->s->model;

    for (size_t c = 0; c < channels; c++) {
        const bool is_anchor = saga_rate_is_anchor(j->kind, c);

        s->unit[c] = is_anchor ? 0 : saga_rate_mu_unit(m, j->kind, c);
        s->most[c] = is_anchor
                         ? 0
                         : saga_rate_most(saga_rate_value_q(m, j->kind, c));
    }
}

/* Converts the network's outputs to mu and log2 sigma. */
static void take_parameters(const job *j, saga_range of)
{
    const size_t channels = saga_n_channels(&j->s->model, j->kind);
    const saga_rate_kind *const k = j->k;
    mu_scale scale;

    scale_mu(&scale, j, channels);
    for (size_t i = of.begin; i < of.end; i++) {
        /* A row of outputs has mu of all channels, then log2 sigma of all
         * channels. */
        const real *const out = k->net.out + 2 * channels * i;
        real *const mu = k->mu + i * channels;
        real *const log2_sigma = k->log2_sigma + i * channels;

        for (size_t c = 0; c < channels; c++) {
            const real most = scale.most[c];

            mu[c] = saga_clamp(scale.unit[c] * out[c], -most, most);
            log2_sigma[c] = saga_clamp(out[channels + c], R(SAGA_RATE_LOG2_MIN),
                                       R(SAGA_RATE_LOG2_MAX));
        }
    }
}

static void bank_forward(real *in, const job *j, saga_range of)
{
    const real *const read = j->c->bank.kind[j->kind].read;
    const size_t d = j->s->model.bank_width;
    size_t i;

    for (i = of.begin; i < of.end; i++)
        memcpy(in + i * j->dim, read + j->k->runs.index[j->list.block[i]] * d,
               d * sizeof *in);
}

/* Sets the inputs of a source that is not kept to 0. */
static void drop(real *in, const job *j, size_t columns, saga_range of)
{
    size_t i;

    for (i = of.begin; i < of.end; i++)
        memset(in + i * j->dim, 0, columns * sizeof *in);
}

/* Sets the inputs of one source. */
static void source_forward(real *in, const job *j, uint32_t source,
                           saga_range of)
{
    if (source == SAGA_SOURCE_HYPER) {
        hyper_forward(j, of);
        copy_columns(in, j->dim, j->k->hyper.out, j->f, j->f, of);
    } else if (source == SAGA_SOURCE_PARENT) {
        parent_forward(in, j, of);
    } else if (source == SAGA_SOURCE_GROUPS) {
        groups_forward(in, j, of);
    } else {
        bank_forward(in, j, of);
    }
}

static void forward_chunk(void *user, size_t chunk)
{
    const job *const j = user;
    const saga_range of = saga_part(j->list.n, CHUNK, chunk);
    const saga_net_pass p = pass_of(j);
    const uint32_t have = j->s->model.sources[j->kind];
    real *in = j->k->net.in;
    uint32_t source;

    /* The side information of primitives contains the supports of their fine
     * anchors, which F_fine computes anew in every iteration. */
    if (j->kind == SAGA_KIND_PRIM)
        saga_rate_place_prims(j->k, j->s, j->x->twin, j->list.block + of.begin,
                              of.end - of.begin);
    for (source = 1; source < SAGA_SOURCES_KNOWN; source <<= 1) {
        /* A source that the network has but that is not kept still has its
         * columns, which are 0. */
        const size_t columns = saga_rate_columns(&j->s->model, source);

        if (!(have & source))
            continue;
        if (!(j->c->keep[j->kind] & source))
            drop(in, j, columns, of);
        else
            source_forward(in, j, source, of);
        in += columns;
    }
    saga_rate_clamp(j->k->net.in + of.begin * j->dim,
                    (of.end - of.begin) * j->dim, j->s->model.q_in[j->net]);
    saga_net_chunk_forward(&p, chunk);
    take_parameters(j, of);
}

void saga_rate_context_forward(saga_rate_context *c, const saga_scene *s,
                               int kind, saga_rate_list list,
                               const saga_rate_features *x)
{
    job j = job_of(c, s, kind, list);
    const saga_net_pass p = pass_of(&j), hyper = hyper_pass_of(&j);
    saga_tasks all = { .run = forward_chunk,
                       .user = &j,
                       .n = saga_n_parts(list.n, CHUNK) };

    j.x = x;
    /* Weights are packed once, before the chunks, which share them. */
    saga_net_begin(&p);
    if (has_hyper(&j))
        saga_net_begin(&hyper);
    all.ns = cost_of(&j, &all.most) * (double)list.n;
    saga_parallel(&all);
}

/* --- Backward ------------------------------------------------------------ */

/* Sets the gradients dy of the outputs of a chunk. */
static void parameters_backward(saga_net_rows dy, const job *j, saga_range of)
{
    const size_t channels = saga_n_channels(&j->s->model, j->kind);
    const saga_rate_kind *const k = j->k;
    mu_scale scale;

    scale_mu(&scale, j, channels);
    for (size_t i = of.begin; i < of.end; i++) {
        real *const d = dy.at + (i - of.begin) * dy.stride;

        for (size_t c = 0; c < channels; c++) {
            const size_t at = i * channels + c;
            const real most = scale.most[c];

            d[c] = scale.unit[c] *
                   saga_inward(k->d_mu[at], k->mu[at], -most, most);
            d[channels + c] = saga_inward(
                k->d_log2_sigma[at], k->log2_sigma[at], R(SAGA_RATE_LOG2_MIN),
                R(SAGA_RATE_LOG2_MAX));
        }
    }
}

/* The gradients of the hyperprior's outputs stay where they are, among those of
 * the inputs of the kind's network. */
static void hyper_backward(const job *j, saga_net_rows d, saga_range of)
{
    const saga_net_pass p = hyper_pass_of(j);

    for (size_t i = 0; i < of.end - of.begin; i++)
        saga_rate_through(d.at + i * d.stride, p.y + (of.begin + i) * j->f,
                          j->f, j->s->model.out_q[SAGA_OUT_HYPER]);
    saga_net_chunk_backward(&p, of.begin / CHUNK, d.at, d.stride);
}

/* Returns the links by which the gradients of a source are added to the
 * features of the anchors that it reads, or NULL if they are not: fine anchors
 * that read groups read offsets of others, which get no gradients from there.
 */
static const saga_links *links_of(const job *j, uint32_t source)
{
    return source == SAGA_SOURCE_PARENT && j->kind == SAGA_KIND_FINE
               ? &j->k->parent
           : source == SAGA_SOURCE_GROUPS && j->kind == SAGA_KIND_COARSE
               ? &j->k->groups
               : NULL;
}

static void parent_backward(const job *j, saga_net_rows d, saga_range of)
{
    const size_t f = j->f;
    size_t i, k;

    for (i = of.begin; i < of.end; i++, d.at += d.stride)
        for (k = 0; k < f; k++)
            j->dx->fine[j->list.block[i] * f + k] += d.at[k];
}

static void bank_backward(const job *j, saga_net_rows d, saga_range of)
{
    real *const d_read = j->c->bank.kind[j->kind].d_read;
    const size_t width = j->s->model.bank_width;
    size_t i;

    for (i = of.begin; i < of.end; i++, d.at += d.stride)
        memcpy(d_read + j->k->runs.index[j->list.block[i]] * width, d.at,
               width * sizeof *d_read);
}

/* Distributes the gradients of a source, which d has from its first column on.
 * For a source with links, of which a kind has at most one, they are only
 * copied to the scratch. */
static void source_backward(const job *j, uint32_t source, saga_net_rows d,
                            saga_range of)
{
    if (links_of(j, source))
        for (size_t i = of.begin; i < of.end; i++, d.at += d.stride)
            saga_copy_row(j->c->scratch + i * j->f, d.at, j->f);
    else if (source == SAGA_SOURCE_HYPER)
        hyper_backward(j, d, of);
    else if (source == SAGA_SOURCE_PARENT)
        parent_backward(j, d, of);
    else if (source == SAGA_SOURCE_BANK)
        bank_backward(j, d, of);
}

static void backward_chunk(const job *j, size_t chunk)
{
    const saga_range of = saga_part(j->list.n, CHUNK, chunk);
    const saga_net_pass p = pass_of(j);
    const uint32_t have = j->s->model.sources[j->kind];
    saga_net_rows d = saga_net_dy(&p);
    uint32_t source;

    parameters_backward(d, j, of);
    d = saga_net_chunk_backward(&p, chunk, d.at, d.stride);
    for (size_t i = 0; i < of.end - of.begin; i++)
        saga_rate_through(d.at + i * d.stride, p.x + (of.begin + i) * j->dim,
                          j->dim, j->s->model.q_in[j->net]);
    for (source = 1; source < SAGA_SOURCES_KNOWN; source <<= 1) {
        if (!(have & source))
            continue;
        if (j->c->keep[j->kind] & source)
            source_backward(j, source, d, of);
        d.at += saga_rate_columns(&j->s->model, source);
    }
}

/* Parts are the networks' blocks. Gradients of weights are summed in each
 * block, and add_sums adds the blocks in order. */
static void backward_block(void *user, size_t block)
{
    const job *const j = user;
    const saga_net_pass p = pass_of(j), hyper = hyper_pass_of(j);
    const saga_range chunks = saga_net_block_chunks(j->list.n, block);

    saga_net_block_begin(&p, block);
    if (has_hyper(j))
        saga_net_block_begin(&hyper, block);
    for (size_t i = chunks.begin; i < chunks.end; i++)
        backward_chunk(j, i);
}

/* Adds sum k of the network, or of the hyperprior, whose sums follow. */
static void add_sum(void *user, size_t k)
{
    const job *const j = user;
    const size_t n = saga_net_n_sums(&j->s->net[j->net]);
    const saga_net_pass p = k < n ? pass_of(j) : hyper_pass_of(j);

    saga_net_add_sum(&j->d->net[k < n ? j->net : SAGA_NET_HYPER], &p,
                     k < n ? k : k - n);
}

static void add_sums(job *j)
{
    const saga_net *const net = &j->s->net[j->net];
    const saga_net *const hyper = &j->s->net[SAGA_NET_HYPER];
    saga_tasks all = { .run = add_sum,
                       .user = j,
                       .n = saga_net_n_sums(net),
                       .ns = saga_net_sums_ns(net, j->list.n) };

    if (has_hyper(j)) {
        all.n += saga_net_n_sums(hyper);
        all.ns += saga_net_sums_ns(hyper, j->list.n);
    }
    saga_parallel(&all);
}

void saga_rate_context_backward(saga_rate_context *c, saga_scene *d,
                                const saga_scene *s, int kind,
                                saga_rate_list list,
                                const saga_rate_features *dx)
{
    job j = job_of(c, s, kind, list);
    saga_tasks all = { .run = backward_block,
                       .user = &j,
                       .n = saga_net_n_blocks(list.n) };
    uint32_t source;

    j.d = d;
    j.dx = dx;
    all.ns = 2 * cost_of(&j, &all.most) * (double)list.n;
    saga_parallel(&all);
    add_sums(&j);
    /* Blocks of the list may share neighbours, so all rows of the scratch must
     * be complete before features get their gradients. */
    for (source = 1; source < SAGA_SOURCES_KNOWN; source <<= 1)
        if (saga_rate_sources(c, s, kind) & source && links_of(&j, source))
            saga_links_scatter(dx->coarse, links_of(&j, source), c->scratch,
                               j.f, list.block, list.n);
}
