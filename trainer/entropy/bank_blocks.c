/* SPDX-License-Identifier: MIT */
#include "bank_blocks.h"

#include "bank_float.h"
#include "threads.h"

#include <string.h>

/* Blocks in one task, and nanoseconds to set the input of a block. */
enum { PART = 64, FILL_NS = 80 };

/* Returns the address of the values that QUERY or AGG reads for a block, or of
 * their gradients, and sets *n to their number; NULL: there are none. A query
 * reads what the block's parent holds, a token what the block itself holds. */
static real *values_of(const saga_bank_twin_input *in,
                       const saga_rate_features *x, size_t block, int is_token,
                       size_t *n)
{
    const size_t f = in->s->model.features;
    const int kind = in->kind;
    real *const from = kind == SAGA_KIND_PRIM ? x->fine
                       : kind == SAGA_KIND_FINE
                           ? is_token ? x->offset : x->coarse
                       : is_token ? x->coarse
                                  : NULL;

    *n = kind == SAGA_KIND_FINE && is_token ? SAGA_RATE_OFFSETS : f;
    if (kind == SAGA_KIND_FINE && !is_token)
        block = in->s->fine[block].parent;
    return from ? from + block * *n : NULL;
}

/* Sets the phase of an anchor to its decoded position. */
static void anchor_phase(real phase[4], const saga_bank_twin_input *in,
                         size_t block)
{
    saga_scene_phase(phase, (in->kind == SAGA_KIND_COARSE ? in->s->coarse_x
                                                          : in->s->fine_x) +
                                4 * block);
}

static void fill_row(real *row, const saga_bank_twin_input *in, int net,
                     size_t block)
{
    const saga_model *const m = &in->s->model;
    const int is_token = net == SAGA_NET_AGG;
    const size_t dim = (size_t)in->s->net[net].dim[0];
    const real *phase = in->phase + 4 * block, *values;
    real anchor[4], *to;
    size_t n;

    /* A query knows only the cell of its block, a token also the anchor's
     * position within it. */
    if (is_token) {
        anchor_phase(anchor, in, block);
        phase = anchor;
    }
    to = saga_rate_inputs(row, m, phase, in->size + SAGA_RATE_SIZES * block);
    *to++ = R(in->kind - 1);
    /* Queries of coarse anchors have no values, and the token of a fine anchor
     * has fewer than F; the rest of the row is 0. */
    memset(to, 0, m->features * sizeof *to);
    values = values_of(in, &in->x, block, is_token, &n);
    if (values)
        memcpy(to, values, n * sizeof *to);
    saga_rate_clamp(row, dim, m->q_in[net]);
}

/* A pass over blocks from .. to - 1 in the order of coding. */
typedef struct {
    saga_twin_batch *b;
    const saga_bank_twin_input *in;
    int net;
    size_t from, to;
} job;

static void fill_part(void *user, size_t part)
{
    const job *const j = user;
    const saga_range of = saga_part(j->to - j->from, PART, part);
    const size_t n_in = (size_t)j->in->s->net[j->net].dim[0];
    size_t i;

    for (i = j->from + of.begin; i < j->from + of.end; i++)
        fill_row(j->b->in + i * n_in, j->in, j->net, j->in->runs->block[i]);
}

void saga_bank_blocks_run(saga_twin_batch *b, const saga_bank_twin_input *in,
                          int net, size_t first, size_t end)
{
    const saga_net *const f = &in->s->net[net];
    const size_t n_in = (size_t)f->dim[0];
    const size_t n_out = (size_t)f->dim[f->n_layers];
    job j = { .b = b, .in = in, .net = net, .from = first, .to = end };

    saga_parallel(
        &(saga_tasks){ .run = fill_part,
                       .user = &j,
                       .n = saga_n_parts(end - first, PART),
                       .ns = (double)FILL_NS * (double)(end - first) });
    saga_net_forward(b->out + first * n_out, &b->work, b->in + first * n_in,
                     end - first, f);
    saga_rate_clamp(b->out + first * n_out, (end - first) * n_out,
                    net == SAGA_NET_AGG ? SAGA_SLOT_Q : SAGA_QUERY_Q);
}

void saga_bank_blocks_backward(saga_scene *d, const saga_rate_features *dx,
                               saga_twin_batch *b,
                               const saga_bank_twin_input *in, int net)
{
    const saga_net *const f = &in->s->net[net];
    const size_t n = saga_rate_n_blocks(in->s, in->kind);
    const size_t n_in = (size_t)f->dim[0];
    const size_t n_out = (size_t)f->dim[f->n_layers];
    /* The inputs before the values (embedding, sizes, kind) are not learned and
     * need no gradients. */
    const size_t side = n_in - in->s->model.features;
    size_t i, k, have;

    saga_rate_through(b->d_out, b->out, n * n_out,
                      net == SAGA_NET_AGG ? SAGA_SLOT_Q : SAGA_QUERY_Q);
    saga_net_backward(b->d_in, &d->net[net], &b->work, b->d_out, b->in, n, f);
    saga_rate_through(b->d_in, b->in, n * n_in, in->s->model.q_in[net]);
    for (i = 0; i < n; i++) {
        /* Several queries of fine anchors share a parent, so one thread adds
         * their gradients, in the order of coding. */
        real *const to = values_of(in, dx, in->runs->block[i],
                                   net == SAGA_NET_AGG, &have);

        for (k = 0; to && k < have; k++)
            to[k] += b->d_in[i * n_in + side + k];
    }
}
