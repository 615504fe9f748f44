/* SPDX-License-Identifier: MIT */
#include "pack.h"

#include "alloc.h"
#include "cost.h"
#include "dense.h"
#include "fx.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* --- Ranges -------------------------------------------------------------- */

/* Embeddings come in this format, and directions in DIRECTION_Q: nothing finer
 * enters a network. */
enum { EMBEDDING_Q = 15, DIRECTION_Q = 14 };

/* Returns the Q format in which values up to `most` fit int16, with a fifth to
 * spare; the network's arithmetic may exceed what was measured a little. */
static uint8_t q_for(double most, int limit)
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

static double most_out(const saga_scene *s, const saga_twin *w, int net,
                       size_t first, size_t n)
{
    const saga_net *const f = &s->net[net];

    return most_of(w->batch[net].out, saga_twin_rows(w, net),
                   (size_t)f->dim[f->n_layers], first, n);
}

/* Batches that an entropy network ran last, and the rows of each. */
typedef struct {
    const saga_twin_batch *b[SAGA_N_KINDS];
    size_t rows[SAGA_N_KINDS], n;
} batches;

static void add_batch(batches *l, const saga_twin_batch *b, size_t rows)
{
    l->b[l->n] = b;
    l->rows[l->n++] = rows;
}

/* Kinds that read it query the bank, tiers before them write into it. */
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

        /* A query for each block of a kind that reads. */
        if (net == SAGA_NET_QUERY && (readers >> kind & 1u))
            add_batch(l, &k->query, r->kind[kind].n_blocks);
        /* Primitives are coded last: nobody reads what they would write. Other
         * kinds write where this kind or a later one reads. */
        if (kind == SAGA_KIND_PRIM || !(readers >> kind))
            continue;
        /* A token for each block; a write for each run, and of each to every
         * slot. */
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

        /* One hyperprior serves all kinds that have it as a source, but each
         * kind has an E of its own. */
        if (net == SAGA_NET_HYPER &&
            (c->scene.model.sources[kind] & SAGA_SOURCE_HYPER))
            add_batch(&l, &k->hyper, k->n_blocks);
        else if (kind == net - SAGA_NET_E_COARSE)
            add_batch(&l, &k->net, k->n_blocks);
    }
    return l;
}

/* These return the largest |x| that an entropy network takes, and gives. */
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

/* Sets the formats of what all entropy networks take and the hyperprior gives,
 * and of the two parts of the write's first layer, whose format its second
 * takes as it is. */
static void entropy_formats(saga_model *m, const saga_rate_choice *c)
{
    int i;

    for (i = 0; i < SAGA_N_ENTROPY_NETS; i++) {
        const int net = saga_scene_net(i);

        m->q_in[net] = q_for(most_taken(c, net), 12);
    }
    /* Slots' and tokens' parts of the write's first layer are made by two
     * networks, and added in this format. */
    m->q_in[SAGA_NET_WRITE] = q_for(fmax(most_taken(c, SAGA_NET_WRITE),
                                         fmax(most_given(c, SAGA_NET_SLOT),
                                              most_given(c,
                                                  SAGA_NET_WRITE_BASE))), 12);
    m->head_q[SAGA_HEAD_HYPER] = q_for(most_given(c, SAGA_NET_HYPER), 12);
    m->head_q[SAGA_HEAD_SIGMA] = SAGA_COST_SIGMA_Q;
}

static double most_feature(const saga_scene *s, const real *feature)
{
    return most_of(feature, s->n.coarse, s->model.features, 0,
                   s->model.features);
}

/* Sets the heads of all networks but the entropy networks: as fine as what they
 * give allows, motion's where it is cut at the coarsest. (1, 0, 0, 0) is added
 * to a quaternion. */
static void head_formats(saga_model *m, const saga_pack_input *in)
{
    const saga_scene *const s = &in->choice->scene;
    saga_rows rows[SAGA_N_HEADS];
    int head;

    saga_model_rows(rows, m);
    for (head = SAGA_HEAD_FUSE_C; head < SAGA_N_HEADS; head++) {
        const saga_rows *const r = &rows[head];
        const bool moves = head >= SAGA_HEAD_MOTION1 &&
                           head <= SAGA_HEAD_MOTION3;

        /* A format finer than most_q is of no use to who reads it. */
        if (r->n)
            m->head_q[head] = (uint8_t)fx_max(q_for(
                (head == SAGA_HEAD_QUAT ? 1 : 0) +
                in->room * most_out(s, in->twin, r->net, r->first, r->n),
                r->most_q),
                moves ? SAGA_TWIN_MOTION_Q : 0);
    }
}

/* Returns the largest pre-activation of units first..first+n-1 of F_color's
 * first layer. */
static double most_before_colour(const saga_scene *s, const saga_twin *w,
                                 size_t first, size_t n)
{
    double most = most_out(s, w, SAGA_NET_COLOUR_BASE, first, n);

    if (s->model.tools & SAGA_TOOL_VIEW)
        most += most_out(s, w, SAGA_NET_COLOUR_VIEW, first, n);
    return most;
}

static void measure_formats(saga_model *m, const saga_pack_input *in)
{
    const saga_scene *const s = &in->choice->scene;
    uint8_t *const q = m->head_q;
    int net;

    /* The default of those that nothing below measures. */
    for (net = 0; net < SAGA_N_NETS; net++)
        m->q_in[net] = 12;
    /* Features have been trained for multiples of this format's steps. */
    q[SAGA_HEAD_COARSE] = s->model.head_q[SAGA_HEAD_COARSE];
    entropy_formats(m, in->choice);
    head_formats(m, in);
    m->q_in[SAGA_NET_COLOUR] = q_for(in->room *
        most_before_colour(s, in->twin, 0, m->width[SAGA_NET_COLOUR]), 14);
    /* What enters a network must not saturate either. */
    m->q_in[SAGA_NET_COLOUR_VIEW] = DIRECTION_Q;
    m->q_in[SAGA_NET_FUSE_C] = q_for(in->room * most_feature(s, in->feature),
                                     EMBEDDING_Q);
    /* Who reads another network takes what that gives, in its format. */
    m->q_in[SAGA_NET_FINE] = m->width[SAGA_NET_FUSE_C]
        ? q[SAGA_HEAD_FUSE_C] : m->q_in[SAGA_NET_FUSE_C];
    m->q_in[SAGA_NET_FUSE_F] = q[SAGA_HEAD_FINE];
    m->q_in[SAGA_NET_GEO] = m->q_in[SAGA_NET_COLOUR_BASE] =
        (uint8_t)saga_fused_q(m, SAGA_TIER_FINE);
}

/* --- Networks ------------------------------------------------------------ */

static const char symbols_of_nets[] = "symbols of the networks";

/* Gives the Q of each row of a network's last layer. What the trainer's entropy
 * networks give for mu is in units of their own. */
static void output_formats(uint8_t *q, const saga_model *m, int net,
                           uint32_t n)
{
    const int kind = net - SAGA_NET_E_COARSE;
    uint32_t i;

    for (i = 0; i < n; i++)
        q[i] = (uint8_t)(kind >= 0 && kind < SAGA_N_KINDS && i < n / 2
                         ? saga_rate_mu_q(m, kind, i)
                         : saga_output_q(m, net, i));
}

/* What every network is packed with. */
typedef struct {
    const saga_model *model;     /* formats measured */
    const saga_rate_choice *choice;
    const saga_twin *twin;
    const saga_weights *steps;   /* NULL: entropy networks alone */
    saga_scene *decoded;         /* NULL, or takes what was quantised: the
                                  * layers, or the rest */
    const saga_nets *shapes;
    double room;                 /* as saga_pack_input has it */
} packing;

/* Returns the largest activation of units first..first+n-1 of hidden layer i
 * (0-based) of the last runs. */
static double most_hidden(const packing *p, int net, int i, size_t first,
                          size_t n)
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

/* Returns how many bits finer than q values up to `most` may be. They get a bit
 * less than they would have room for: a later segment's may be larger. Weights
 * of 8 bits cannot be shifted down. */
static uint8_t finer_by(const packing *p, int net, double most, int q)
{
    const int reader = net == SAGA_NET_COLOUR_BASE ? SAGA_NET_COLOUR : net;
    const int more = q_for(2 * p->room * most,
                           EMBEDDING_Q + SAGA_N_FINER - 1) - q;

    return p->model->int8[reader] ? 0
         : (uint8_t)fx_clamp(more, 0, SAGA_N_FINER - 1);
}

/* Returns the largest value of row k of layer i, of units of F_color's first
 * layer with what the direction may add. */
static double most_row(const packing *p, int net, int i, uint32_t k)
{
    const saga_scene *const s = &p->choice->scene;

    if (i + 1 < s->net[net].n_layers)
        return most_hidden(p, net, i, k, 1);
    if (net == SAGA_NET_COLOUR_BASE)
        return most_before_colour(s, p->twin, k, 1);
    return most_out(s, p->twin, net, k, 1);
}

/* Gives the formats of a layer's rows: q[row] of all, `finer` of those that
 * have one, which q includes. Returns what the next layer calls its q_in. */
static int row_formats(uint8_t *q, uint8_t *finer, const packing *p,
                       const saga_net_symbols *nets, int net, int i)
{
    const saga_scene *const s = &p->choice->scene;
    const uint32_t n = (uint32_t)s->net[net].dim[i + 1];
    int common;
    uint32_t k;

    /* A format for the whole layer first: of an output it is the head's, of
     * hidden units what the largest of them needs. */
    if (i + 1 == s->net[net].n_layers)
        output_formats(q, p->model, net, n);
    else
        memset(q, q_for(p->room * most_hidden(p, net, i, 0, n), EMBEDDING_Q),
               n);
    common = q[0];
    /* Then some rows have bits of their own, where they are small. */
    for (k = 0; k < saga_nets_n_finer(p->shapes, net, i); k++) {
        finer[k] = finer_by(p, net, most_row(p, net, i, k), common);
        q[k] = (uint8_t)(common + finer[k]);
    }
    /* What the direction adds has to be in the format of what it is added
     * to. */
    for (k = 0; net == SAGA_NET_COLOUR_VIEW && k < n; k++)
        q[k] = (uint8_t)(common +
                         nets->layer[SAGA_NET_COLOUR_BASE][0].finer[k]);
    return common;
}

/* Gives the formats of what a layer takes: of the rows that come before it. */
static void input_formats(saga_layer_values *v, const saga_net_symbols *nets,
                          const packing *p, int net, int i)
{
    /* A first layer may read another network's rows as they are: then that
     * network's last layer came before this one. */
    if (i == 0 && saga_nets_takes(p->shapes, net) >= 0) {
        net = saga_nets_takes(p->shapes, net);
        i = p->shapes->shape[net].n_layers;
    }
    v->n_finer = i ? saga_nets_n_finer(p->shapes, net, i - 1) : 0;
    v->finer = i ? nets->layer[net][i - 1].finer : NULL;
}

/* The entropy networks' biases are as fine as what they give. */
static const real entropy_bias_step = 1.0f / 2048;

static void set_layer_steps(saga_layer_values *v, const saga_rate_choice *c,
                            const saga_weights *steps, int net, int layer)
{
    if (saga_is_entropy_net(net)) {
        v->step = (real)c->rate->decision.step[net];
        v->bias_step = entropy_bias_step;
    } else {
        const int t = saga_weights_find(steps, net, layer);

        v->step = (real)saga_weights_step(steps, t);
        v->bias_step = (real)saga_weights_step(steps, t + 1);
    }
}

static bool pack_layer(saga_net_symbols *out, int *q_in, const packing *p,
                       int net, int i, saga_error *error)
{
    const saga_net *const f = &p->choice->scene.net[net];
    const uint32_t n_out = (uint32_t)f->dim[i + 1];
    saga_layer_symbols *const l = &out->layer[net][i];
    uint8_t q[SAGA_MAX_VECTOR];
    saga_layer_values v = {
        f->w[i], f->b[i], (uint32_t)f->dim[i], n_out, *q_in, q, NULL, 0, 0, 0,
        p->model->int8[net]
    };

    l->finer = saga_calloc(n_out, 1, symbols_of_nets, error);
    if (!l->finer)
        return false;
    /* Outputs before inputs: the next layer's q_in is what row_formats returns,
     * v has taken this one's. */
    *q_in = row_formats(q, l->finer, p, out, net, i);
    input_formats(&v, out, p, net, i);
    set_layer_steps(&v, p->choice, p->steps, net, i);
    if (!saga_quantise_layer(l, &v, error))
        return false;
    /* In reals, for the decoded scene and for segments that take these
     * networks. */
    if (p->decoded)
        saga_dequantise_layer(p->decoded->net[net].w[i],
                              p->decoded->net[net].b[i], l, &v);
    return true;
}

static bool pack_net(saga_net_symbols *out, const packing *p, int net,
                     saga_error *error)
{
    int q_in = p->model->q_in[net], i;

    for (i = 0; i < p->choice->scene.net[net].n_layers; i++)
        if (!pack_layer(out, &q_in, p, net, i, error))
            return false;
    return true;
}

/* A network without inputs has biases alone: the parameters, row by row. */
static bool pack_constants(saga_net_symbols *out, int net,
                           const int32_t *value, uint32_t n,
                           saga_error *error)
{
    saga_layer_symbols *const l = &out->layer[net][0];

    /* Constants are of any size: they get the widest of the deviations. */
    l->step_q16 = 1;
    l->bias_scale = 63;
    l->weight = saga_calloc(1, sizeof *l->weight, symbols_of_nets, error);
    l->bias = saga_alloc(n, sizeof *l->bias, symbols_of_nets, error);
    l->shift = saga_calloc(n, 1, symbols_of_nets, error);
    if (!l->weight || !l->bias || !l->shift)
        return false;
    memcpy(l->bias, value, n * sizeof *l->bias);
    return true;
}

/* A kind without sources has constants per channel. */
static bool pack_entropy(saga_net_symbols *out, const packing *p, int kind,
                         saga_error *error)
{
    const saga_rate_constants *const c = &p->choice->rate->constants;
    const uint32_t n = saga_n_channels(p->model, kind);
    int32_t v[2 * (4 + SAGA_MAX_FEATURES)];
    uint32_t i;

    for (i = 0; i < n; i++) {
        const double mean = (double)c->mean[kind][i];

        /* As rows of a network would be: means in the values' format, then log2
         * of the deviations. */
        v[i] = (int32_t)lrint(ldexp(mean, saga_rate_value_q(p->model, kind,
                                                            i)));
        v[n + i] = (int32_t)lrint(ldexp((double)c->log2_sigma[kind][i],
                                        SAGA_COST_SIGMA_Q));
    }
    return pack_constants(out, SAGA_NET_E_COARSE + kind, v, 2 * n, error);
}

static bool pack_nets(saga_net_symbols *out, const packing *p,
                      saga_error *error)
{
    bool ok = true;
    int net;

    memset(out, 0, sizeof *out);
    for (net = 0; net < SAGA_N_NETS && ok; net++) {
        const int kind = net - SAGA_NET_E_COARSE;

        /* Absent networks; and without steps, all but the entropy model's. */
        if (!p->choice->scene.net[net].n_layers ||
            (!p->steps && !saga_is_entropy_net(net)))
            continue;
        ok = kind >= 0 && kind < SAGA_N_KINDS && !p->model->sources[kind]
            ? pack_entropy(out, p, kind, error)
            : pack_net(out, p, net, error);
    }
    if (!ok)
        saga_net_symbols_free(out);
    return ok;
}

bool saga_pack_entropy(saga_net_symbols *nets, saga_model *m,
                       const saga_rate_choice *choice, const saga_twin *twin,
                       saga_error *error)
{
    saga_nets shapes;
    const packing p = { m, choice, twin, NULL, NULL, &shapes, 1 };

    saga_nets_layout(&shapes, m);
    entropy_formats(m, choice);
    return pack_nets(nets, &p, error);
}

/* --- Segment ------------------------------------------------------------- */

static const char positions[] = "positions of the anchors";

static double *to_units(const real *x, size_t n, saga_error *error)
{
    double *const u = saga_alloc(4 * n, sizeof *u, positions, error);
    size_t i;

    for (i = 0; u && i < 4 * n; i++)
        /* A half-cube is 2^23 box units, a segment 65536 time units. */
        u[i] = (double)x[i] * (i % 4 < 3 ? 8388608.0 : 65536.0);
    return u;
}

static bool alloc_symbols(saga_symbols *y, const saga_scene *s,
                          const saga_scene_layer *l, saga_error *error)
{
    static const char what[] = "symbols of the scene";
    const size_t coarse = l->n.coarse, fine = l->n.fine, prim = l->n.prim;
    const size_t one = sizeof(int32_t), four = 4 * sizeof(int32_t);
    uint32_t i;

    /* The tree is the scene's own; all other arrays are ours, and the closed
     * loop fills them but for counts and suffixes. */
    y->n = l->n;
    y->n_nodes = l->n_nodes;
    y->split = s->split + l->first_node;
    y->occupancy = s->occupancy + l->first_node;
    y->n_fine = saga_alloc(coarse, 1, what, error);
    y->centre = saga_calloc(coarse, four, what, error);
    y->feature = saga_calloc(coarse, s->model.features * one, what, error);
    y->fine_suffix = saga_alloc(fine, one, what, error);
    y->fine_offset = saga_calloc(fine, four, what, error);
    y->n_prim = saga_alloc(fine, 1, what, error);
    y->prim_suffix = saga_calloc(prim, one, what, error);
    y->prim_offset = saga_calloc(prim, four, what, error);
    /* One question for all of them: the first that failed is told. */
    if (saga_failed(error))
        return false;
    for (i = 0; i < coarse; i++)
        y->n_fine[i] = s->coarse[l->first.coarse + i].n_fine;
    for (i = 0; i < fine; i++) {
        y->n_prim[i] = s->fine[l->first.fine + i].n_prim;
        y->fine_suffix[i] = saga_scene_fine_suffix(s, l->first.fine + i);
    }
    return true;
}

static void free_symbols(saga_symbols *y)
{
    free(y->n_fine);
    free(y->centre);
    free(y->feature);
    free(y->fine_suffix);
    free(y->fine_offset);
    free(y->n_prim);
    free(y->prim_suffix);
    free(y->prim_offset);
}

/* (n, 4) units become half-cubes and segments again. */
static void from_units(real *x, const double *u, size_t n)
{
    size_t i;

    for (i = 0; i < 4 * n; i++)
        x[i] = (real)(u[i] / (i % 4 < 3 ? 8388608.0 : 65536.0));
}

/* The decoded scene has the same structure, and the file's networks; its other
 * reals are to be filled in. */
static bool begin_decoded(saga_scene *d, const saga_scene *s,
                          const saga_scene *networks, saga_error *error)
{
    if (!saga_scene_init(d, &networks->model, s->n, s->n_nodes, 0, error))
        return false;
    d->still = s->still;
    d->n_layers = s->n_layers;
    memcpy(d->layer, s->layer, sizeof s->layer);
    /* Networks of the file, not those that were trained. */
    memcpy(d->params, networks->params,
           networks->n_reals * sizeof *networks->params);
    memcpy(d->split, s->split, s->n_nodes);
    memcpy(d->occupancy, s->occupancy, s->n_nodes * sizeof *s->occupancy);
    memcpy(d->coarse, s->coarse, s->n.coarse * sizeof *s->coarse);
    memcpy(d->fine, s->fine, s->n.fine * sizeof *s->fine);
    memcpy(d->prim_fine, s->prim_fine, s->n.prim * sizeof *s->prim_fine);
    return true;
}

/* The closed loop was to meet these, in units; what it did meet lies over it,
 * but for the primitives, which change their order. */
typedef struct {
    double *coarse, *fine, *prim, *prim_out;
    real *feature;
    uint32_t *order;
} units;

static bool begin_units(units *u, const saga_scene *s, saga_error *error)
{
    u->coarse = to_units(s->coarse_x, s->n.coarse, error);
    u->fine = to_units(s->fine_x, s->n.fine, error);
    u->prim = to_units(s->prim_x, s->n.prim, error);
    u->prim_out = saga_alloc(4 * (size_t)s->n.prim, sizeof *u->prim_out,
                             positions, error);
    u->feature = saga_alloc((size_t)s->n.coarse * s->model.features,
                            sizeof *u->feature, "decoded features", error);
    u->order = saga_alloc(s->n.prim, sizeof *u->order, positions, error);
    return !saga_failed(error);
}

static void free_units(units *u)
{
    free(u->coarse);
    free(u->fine);
    free(u->prim);
    free(u->prim_out);
    free(u->feature);
    free(u->order);
}

/* Runs the closed loop of a layer. */
static bool close_layer(saga_symbols *y, const saga_encoder *e,
                        saga_quantise_report *report, const packing *p,
                        const units *u, const saga_scene_layer *l,
                        saga_error *error)
{
    const saga_scene *const s = &p->choice->scene;
    const size_t features = s->model.features;
    const size_t coarse = 4 * (size_t)l->first.coarse;
    const size_t fine = 4 * (size_t)l->first.fine;
    const size_t prim = 4 * (size_t)l->first.prim;
    /* Offsets are given beside the positions: they are what is coded, and
     * positions follow. */
    const saga_targets t = {
        u->coarse + coarse, s->coarse_feature + features * l->first.coarse,
        u->fine + fine, u->prim + prim, p->twin->prim_offset + prim, NULL
    };
    /* What is decoded is written once all is coded, so that anchors may lie in
     * the same arrays. Primitives of an anchor are sorted by suffix: they need
     * others. */
    const saga_decoded d = {
        u->coarse + coarse, u->fine + fine, u->prim_out + prim,
        u->feature + features * l->first.coarse, u->order + l->first.prim
    };
    saga_quantise_report own;
    const bool ok = saga_quantise_segment(y, &own, e, &t, &d, error);

    report->n_clamped += own.n_clamped;
    return ok;
}

/* Fills the symbols y of all layers, whose arrays are there. Supports come out
 * of the integer networks a little different. Offsets that were trained to be
 * cheap stay what they are, and positions move by that little: against the
 * positions they would be anywhere again. */
static bool close_loop(saga_symbols *y, const saga_encoder *e,
                       saga_quantise_report *report, const packing *p,
                       saga_error *error)
{
    const saga_scene *const s = &p->choice->scene;
    units u;
    bool ok = begin_units(&u, s, error);

    memset(report, 0, sizeof *report);
    for (uint32_t i = 0; i < s->n_layers && ok; i++)
        ok = close_layer(&y[i], e, report, p, &u, &s->layer[i], error);
    if (ok && p->decoded) {
        from_units(p->decoded->coarse_x, u.coarse, s->n.coarse);
        from_units(p->decoded->fine_x, u.fine, s->n.fine);
        from_units(p->decoded->prim_x, u.prim_out, s->n.prim);
        memcpy(p->decoded->coarse_feature, u.feature,
               (size_t)s->n.coarse * p->model->features * sizeof *u.feature);
    }
    free_units(&u);
    return ok;
}

/* --- The file ------------------------------------------------------------ */

/* Sets the constants to what kinds without sources are coded with. */
static void keep_constants(saga_rate_constants *c, const saga_model *m)
{
    for (int kind = 0; kind < SAGA_N_KINDS; kind++)
        for (uint32_t i = 0; i < saga_n_channels(m, kind); i++) {
            const int q = saga_rate_value_q(m, kind, i);
            real *const mean = &c->mean[kind][i];
            real *const sigma = &c->log2_sigma[kind][i];

            /* To the integers that pack_entropy writes. */
            *mean = (real)ldexp(rint(ldexp((double)*mean, q)), -q);
            *sigma = (real)ldexp(rint(ldexp((double)*sigma,
                                             SAGA_COST_SIGMA_Q)),
                                  -SAGA_COST_SIGMA_Q);
        }
}

bool saga_pack_begin(saga_packed *file, const saga_pack_input *in,
                     const saga_header *header, const saga_rig_camera *rig,
                     saga_error *error)
{
    saga_header h = *header;
    saga_scene *const networks = &file->networks.scene;
    saga_nets shapes;
    const packing p = { &h.model, in->choice, in->twin, in->weights,
                        networks, &shapes, in->room };
    saga_net_symbols nets;

    h.model = in->choice->scene.model;
    h.more_layers = (uint8_t)(in->choice->scene.n_layers - 1);
    saga_nets_layout(&shapes, &h.model);
    /* Formats come first: symbols of all networks are in them. */
    measure_formats(&h.model, in);
    file->networks.constants = in->choice->rate->constants;
    keep_constants(&file->networks.constants, &h.model);
    if (!saga_scene_init(networks, &h.model, (saga_counts){ 0 }, 0, 0, error))
        return false;
    /* The encoder copies what it needs of the symbols. */
    if (pack_nets(&nets, &p, error)) {
        file->encoder = saga_encoder_open(&h, rig, &nets, error);
        saga_net_symbols_free(&nets);
    }
    if (!file->encoder)
        saga_packed_free(file);
    return file->encoder != NULL;
}

/* Makes the symbols of what is packed, layer by layer (free_layers, also after
 * a failure). */
static bool make_symbols(saga_symbols y[SAGA_MAX_LAYERS],
                         const saga_packed *file,
                         saga_quantise_report *report, saga_scene *decoded,
                         const saga_pack_input *in, saga_error *error)
{
    const saga_scene *const networks = &file->networks.scene;
    const saga_scene *const s = &in->choice->scene;
    const packing p = { &networks->model, in->choice, in->twin, NULL,
                        decoded, NULL, 1 };
    bool ok = !decoded || begin_decoded(decoded, s, networks, error);

    memset(y, 0, SAGA_MAX_LAYERS * sizeof *y);
    for (uint32_t i = 0; i < s->n_layers && ok; i++)
        ok = alloc_symbols(&y[i], s, &s->layer[i], error);
    return ok && close_loop(y, file->encoder, report, &p, error);
}

static void free_layers(saga_symbols y[SAGA_MAX_LAYERS])
{
    for (int i = 0; i < SAGA_MAX_LAYERS; i++)
        free_symbols(&y[i]);
}

bool saga_pack_segment(saga_packed *file, uint32_t place, uint32_t n_frames,
                       saga_quantise_report *report, saga_scene *decoded,
                       const saga_pack_input *in, saga_error *error)
{
    saga_symbols y[SAGA_MAX_LAYERS];
    const bool ok =
        make_symbols(y, file, report, decoded, in, error) &&
        saga_encoder_insert(file->encoder, place, y, n_frames, error);

    free_layers(y);
    return ok;
}

bool saga_pack_base(saga_packed *file, saga_quantise_report *report,
                    saga_scene *decoded, const saga_pack_input *in,
                    saga_error *error)
{
    saga_symbols y[SAGA_MAX_LAYERS];
    const bool ok = make_symbols(y, file, report, decoded, in, error) &&
                    saga_encoder_base(file->encoder, y, error);

    free_layers(y);
    return ok;
}

void saga_packed_free(saga_packed *file)
{
    saga_encoder_free(file->encoder);
    saga_scene_free(&file->networks.scene);
    memset(file, 0, sizeof *file);
}
