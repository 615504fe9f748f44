/* SPDX-License-Identifier: MIT
 *
 * Derives number formats from the largest inputs and outputs in the last run of
 * the networks: as fine as int16 allows with room to spare.
 */
#include "pack_state.h"

#include "cost.h"
#include "dense.h"
#include "fx.h"

#include <math.h>

/* Directions are in this Q format. */
enum { DIRECTION_Q = 14 };

/* --- Ranges --------------------------------------------------------------- */

/* Returns the finest format with a fifth of int16 to spare, since the integer
 * networks may slightly exceed what was measured. */
uint8_t saga_pack_q(double most, int limit)
{
    const int q = (int)floor(log2(32767 / fmax(1.25 * most, 1e-6)));

    return (uint8_t)(q < 0 ? 0 : q > limit ? limit : q);
}

/* Returns the largest |x| of columns first..first+n-1 of a (rows, dim) array.
 */
static double most_of(const real *x, size_t rows, size_t dim, size_t first,
                      size_t n)
{
    double most = 0;
    size_t i, k;

    for (i = 0; i < rows; i++)
        for (k = first; k < first + n; k++)
            most = fmax(most, fabs((double)x[i * dim + k]));
    return most;
}

double saga_pack_most_out(const saga_scene *s, const saga_twin *w, int net,
                          size_t first, size_t n)
{
    const saga_net *const f = &s->net[net];

    return most_of(w->batch[net].out, saga_twin_rows(w, net),
                   (size_t)f->dim[f->n_layers], first, n);
}

/* The batches that an entropy network ran last, and the number of rows of
 * each. */
typedef struct {
    const saga_twin_batch *b[SAGA_N_KINDS];
    size_t rows[SAGA_N_KINDS], n;
} batches;

static void add_batch(batches *l, const saga_twin_batch *b, size_t rows)
{
    l->b[l->n] = b;
    l->rows[l->n++] = rows;
}

/* Lists the batches of a network of the bank. Kinds that read the bank query
 * it, and earlier kinds write into it. */
static void bank_batches(batches *l, const saga_rate_choice *c, int net)
{
    const saga_rate_context *const r = &c->rate->context;
    const uint32_t readers = saga_rate_readers(r, &c->scene);
    int kind;

    if (net == SAGA_NET_SLOT) {
        add_batch(l, &r->bank.slot, r->bank.n_slots);
        return;
    }
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_bank_twin_kind *const k = &r->bank.kind[kind];
        const size_t runs = r->kind[kind].runs.n;

        /* One query for each block of a kind that reads. */
        if (net == SAGA_NET_QUERY && (readers >> kind & 1u))
            add_batch(l, &k->query, r->kind[kind].n_blocks);
        /* Primitives are coded last, so nothing reads what they would write.
         * The other kinds write if their own or a later kind reads. */
        if (kind == SAGA_KIND_PRIM || !(readers >> kind))
            continue;
        /* One token for each block; one write for each run and, within it, for
         * each slot. */
        if (net == SAGA_NET_AGG)
            add_batch(l, &k->token, r->kind[kind].n_blocks);
        else if (net == SAGA_NET_WRITE_BASE)
            add_batch(l, &k->base, runs);
        else if (net == SAGA_NET_WRITE)
            add_batch(l, &k->write, runs * r->bank.n_slots);
    }
}

static batches entropy_batches(const saga_rate_choice *c, int net)
{
    batches l = { .n = 0 };
    int kind;

    if (!c->scene.net[net].n_layers)
        return l;
    if (net >= SAGA_NET_QUERY) {
        bank_batches(&l, c, net);
        return l;
    }
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_kind *const k = &c->rate->context.kind[kind];

        /* All kinds with the hyperprior as a source share one network, but each
         * kind has an E of its own. */
        if (net == SAGA_NET_HYPER &&
            (c->scene.model.sources[kind] & SAGA_SOURCE_HYPER))
            add_batch(&l, &k->hyper, k->n_blocks);
        else if (kind == net - SAGA_NET_E_COARSE)
            add_batch(&l, &k->net, k->n_blocks);
    }
    return l;
}

/* Return the largest |x| among the inputs, and among the outputs, of an entropy
 * network. */
static double most_taken(const saga_rate_choice *c, int net)
{
    const size_t dim = (size_t)c->scene.net[net].dim[0];
    const batches l = entropy_batches(c, net);
    double most = 0;
    size_t i;

    for (i = 0; i < l.n && dim; i++)
        most = fmax(most, most_of(l.b[i]->in, l.rows[i], dim, 0, dim));
    return most;
}

static double most_given(const saga_rate_choice *c, int net)
{
    const saga_net *const f = &c->scene.net[net];
    const size_t dim = (size_t)f->dim[f->n_layers];
    const batches l = entropy_batches(c, net);
    double most = 0;
    size_t i;

    for (i = 0; i < l.n; i++)
        most = fmax(most, most_of(l.b[i]->out, l.rows[i], dim, 0, dim));
    return most;
}

static double most_feature(const saga_scene *s, const real *feature)
{
    return most_of(feature, s->n.coarse, s->model.features, 0,
                   s->model.features);
}

double saga_pack_most_before_colour(const saga_scene *s, const saga_twin *w,
                                    size_t first, size_t n)
{
    double most = saga_pack_most_out(s, w, SAGA_NET_COLOUR_BASE, first, n);

    if (s->model.tools & SAGA_TOOL_VIEW)
        most += saga_pack_most_out(s, w, SAGA_NET_COLOUR_VIEW, first, n);
    return most;
}

double saga_pack_most_hidden(const saga_packing *p, int net, int i,
                             size_t first, size_t n)
{
    const size_t dim = (size_t)p->choice->scene.net[net].dim[i + 1];
    batches l = { .n = 0 };
    double most = 0;
    size_t k;

    if (saga_is_entropy_net(net))
        l = entropy_batches(p->choice, net);
    else
        add_batch(&l, &p->twin->batch[net], saga_twin_rows(p->twin, net));
    for (k = 0; k < l.n; k++)
        most = fmax(most, most_of(l.b[k]->work.hidden[i], l.rows[k],
                                  saga_dense_pad(dim), first, n));
    return most;
}

/* --- Formats -------------------------------------------------------------- */

/* Sets the formats of all inputs of entropy networks, of the hyperprior's
 * output, and of the two parts of the write's first layer. Their sum is the
 * input of its second layer, so they share a format. */
void saga_pack_entropy_formats(saga_model *m, const saga_rate_choice *c)
{
    int i;

    for (i = 0; i < SAGA_N_ENTROPY_NETS; i++) {
        const int net = saga_scene_net(i);

        m->q_in[net] = saga_pack_q(most_taken(c, net), 12);
    }
    /* The first layer of the write is computed in two parts, one from slots and
     * one from tokens, which are added in this format. */
    m->q_in[SAGA_NET_WRITE] = saga_pack_q(
        fmax(most_taken(c, SAGA_NET_WRITE),
             fmax(most_given(c, SAGA_NET_SLOT),
                  most_given(c, SAGA_NET_WRITE_BASE))),
        12);
    m->out_q[SAGA_OUT_HYPER] = saga_pack_q(most_given(c, SAGA_NET_HYPER), 12);
    m->out_q[SAGA_OUT_SIGMA] = SAGA_COST_SIGMA_Q;
}

/* Sets the formats of the outputs of all networks except the entropy networks:
 * as fine as their range allows, but motion no coarser than the twin rounds it.
 * A quaternion has (1, 0, 0, 0) added, hence the 1. */
static void out_formats(saga_model *m, const saga_pack_input *in)
{
    const saga_scene *const s = &in->choice->scene;
    saga_rows rows[SAGA_N_OUTS];
    int out;

    saga_model_rows(rows, m);
    for (out = SAGA_OUT_FUSE_C; out < SAGA_N_OUTS; out++) {
        const saga_rows *const r = &rows[out];
        const bool moves = out >= SAGA_OUT_MOTION1 && out <= SAGA_OUT_MOTION3;

        /* most_q is the finest format that its reader can use. */
        if (r->n)
            m->out_q[out] = (uint8_t)fx_max(
                saga_pack_q((out == SAGA_OUT_QUAT ? 1 : 0) +
                                in->room * saga_pack_most_out(s, in->twin,
                                                              r->net, r->first,
                                                              r->n),
                            r->most_q),
                moves ? SAGA_TWIN_MOTION_Q : 0);
    }
}

void saga_pack_measure_formats(saga_model *m, const saga_pack_input *in)
{
    const saga_scene *const s = &in->choice->scene;
    uint8_t *const q = m->out_q;
    int net;

    /* The default for inputs that are not measured below. */
    for (net = 0; net < SAGA_N_NETS; net++)
        m->q_in[net] = 12;
    /* Coarse features keep the format that they had in training, because their
     * steps refer to it. */
    q[SAGA_OUT_COARSE] = s->model.out_q[SAGA_OUT_COARSE];
    saga_pack_entropy_formats(m, in->choice);
    out_formats(m, in);
    m->q_in[SAGA_NET_COLOUR] = saga_pack_q(
        in->room * saga_pack_most_before_colour(s, in->twin, 0,
                                                m->width[SAGA_NET_COLOUR]),
        14);
    /* The formats of inputs must hold the measured values, too. */
    m->q_in[SAGA_NET_COLOUR_VIEW] = DIRECTION_Q;
    m->q_in[SAGA_NET_FUSE_C] = saga_pack_q(
        in->room * most_feature(s, in->feature), SAGA_EMBEDDING_Q);
    /* A network that reads another network's output takes it in that format. */
    m->q_in[SAGA_NET_FINE] = m->width[SAGA_NET_FUSE_C]
                                 ? q[SAGA_OUT_FUSE_C]
                                 : m->q_in[SAGA_NET_FUSE_C];
    m->q_in[SAGA_NET_FUSE_F] = q[SAGA_OUT_FINE];
    m->q_in[SAGA_NET_GEO] = m->q_in[SAGA_NET_COLOUR_BASE] =
        (uint8_t)saga_fused_q(m, SAGA_TIER_FINE);
}
