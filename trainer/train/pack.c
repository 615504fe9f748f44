/* SPDX-License-Identifier: MIT */
#include "pack.h"

#include "cost.h"
#include "dense.h"
#include "fx.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static void *must(void *p)
{
    if (!p)
        abort();
    return p;
}

/* --- Ranges -------------------------------------------------------------- */

/* Q format in which values up to `most` fit int16, with a fifth to spare; the
 * network's arithmetic may exceed what was measured a little. */
static uint8_t q_for(double most, int limit)
{
    const int q = (int)floor(log2(32767 / fmax(1.25 * most, 1e-6)));

    return (uint8_t)(q < 0 ? 0 : q > limit ? limit : q);
}

/* Largest |x| of columns first..first+n-1 of a (rows, dim) array. */
static double most_of(const float *x, size_t rows, size_t dim, size_t first,
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

/* Batches that an entropy network ran last, and their rows. */
typedef struct {
    const saga_twin_batch *b[SAGA_N_KINDS];
    size_t rows[SAGA_N_KINDS], n;
} batches;

static void add_batch(batches *l, const saga_twin_batch *b, size_t rows)
{
    l->b[l->n] = b;
    l->rows[l->n++] = rows;
}

/* Kinds that read it query the memory, levels before them write into it. */
static void memory_batches(batches *l, const saga_rate_choice *c, int net)
{
    const saga_rate_context *const r = &c->rate->context;
    const uint32_t readers = saga_rate_readers(r, &c->scene);
    int kind;

    if (net == SAGA_NET_SLOT) {
        add_batch(l, &r->memory.slot, r->memory.n_slots);
        return;
    }
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_memory_kind *const k = &r->memory.kind[kind];
        const size_t runs = r->kind[kind].runs.n;

        if (net == SAGA_NET_QUERY && (readers >> kind & 1u))
            add_batch(l, &k->query, r->kind[kind].n_blocks);
        if (kind == SAGA_KIND_PRIM || !(readers >> kind))
            continue;
        if (net == SAGA_NET_AGG)
            add_batch(l, &k->token, r->kind[kind].n_blocks);
        else if (net == SAGA_NET_WRITE_BASE)
            add_batch(l, &k->base, runs);
        else if (net == SAGA_NET_WRITE)
            add_batch(l, &k->write, runs * r->memory.n_slots);
    }
}

static batches entropy_batches(const saga_rate_choice *c, int net)
{
    batches l = { .n = 0 };
    int kind;

    if (!c->scene.net[net].n_layers)
        return l;
    if (net >= SAGA_NET_QUERY) {
        memory_batches(&l, c, net);
        return l;
    }
    for (kind = 0; kind < SAGA_N_KINDS; kind++) {
        const saga_rate_kind *const k = &c->rate->context.kind[kind];

        if (net == SAGA_NET_HYPER &&
            (c->scene.model.sources[kind] & SAGA_SOURCE_HYPER))
            add_batch(&l, &k->hyper, k->n_blocks);
        else if (kind == net - SAGA_NET_E_COARSE)
            add_batch(&l, &k->net, k->n_blocks);
    }
    return l;
}

/* Largest |x| that an entropy network takes, and gives. */
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

/* Inputs of all entropy networks; the outputs of the hyperprior; and of the two
 * parts of the write's first layer, whose format its second takes as it is. */
static void entropy_formats(saga_model *m, const saga_rate_choice *c)
{
    int i;

    for (i = 0; i < SAGA_N_ENTROPY_NETS; i++) {
        const int net = saga_scene_net(i);

        m->q_in[net] = q_for(most_taken(c, net), 12);
    }
    m->q_in[SAGA_NET_WRITE] = q_for(fmax(most_taken(c, SAGA_NET_WRITE),
                                         fmax(most_given(c, SAGA_NET_SLOT),
                                              most_given(c,
                                                  SAGA_NET_WRITE_BASE))), 12);
    m->head_q[SAGA_HEAD_HYPER] = q_for(most_given(c, SAGA_NET_HYPER), 12);
    m->head_q[SAGA_HEAD_SIGMA] = SAGA_COST_SIGMA_Q;
}

static double most_feature(const saga_scene *s, const float *feature)
{
    return most_of(feature, s->n.coarse, s->model.features, 0,
                   s->model.features);
}

/* The heads of all networks but the entropy networks: as fine as what they give
 * allows. (1, 0, 0, 0) is added to a quaternion. */
static void head_formats(saga_model *m, const saga_scene *s,
                         const saga_twin *w)
{
    saga_rows rows[SAGA_N_HEADS];
    int head;

    saga_model_rows(rows, m);
    for (head = SAGA_HEAD_FUSE_C; head < SAGA_N_HEADS; head++) {
        const saga_rows *const r = &rows[head];

        if (r->n)
            m->head_q[head] = q_for(
                (head == SAGA_HEAD_QUAT ? 1 : 0) +
                most_out(s, w, r->net, r->first, r->n), r->most_q);
    }
}

/* The pre-activations of the colour network and its input share a format. */
static uint8_t colour_format(const saga_scene *s, const saga_twin *w)
{
    const size_t width = s->model.width[SAGA_NET_COLOUR];
    double most = most_out(s, w, SAGA_NET_COLOUR_BASE, 0, width);

    if (s->model.tools & SAGA_TOOL_VIEW)
        most += most_out(s, w, SAGA_NET_COLOUR_VIEW, 0, width);
    return q_for(most, 14);
}

static void measure_formats(saga_model *m, const saga_scene *s,
                            const saga_twin *w, const float *feature,
                            const saga_rate_choice *c)
{
    uint8_t *const q = m->head_q;
    int net;

    for (net = 0; net < SAGA_N_NETS; net++)
        m->q_in[net] = 12;
    q[SAGA_HEAD_COARSE] = s->model.head_q[SAGA_HEAD_COARSE];
    entropy_formats(m, c);
    head_formats(m, s, w);
    m->q_in[SAGA_NET_COLOUR] = colour_format(s, w);
    /* What enters a network must not saturate either. */
    m->q_in[SAGA_NET_FUSE_C] = q_for(most_feature(s, feature), 12);
    m->q_in[SAGA_NET_FINE] = m->width[SAGA_NET_FUSE_C]
        ? (uint8_t)fx_min(q[SAGA_HEAD_FUSE_C], 12) : m->q_in[SAGA_NET_FUSE_C];
    m->q_in[SAGA_NET_FUSE_F] = (uint8_t)fx_min(q[SAGA_HEAD_FINE], 12);
    m->q_in[SAGA_NET_GEO] = m->q_in[SAGA_NET_COLOUR_BASE] =
        (uint8_t)fx_min(saga_fused_q(m, SAGA_LEVEL_FINE), 12);
}

/* --- Networks ------------------------------------------------------------ */

/* Q of each output row of a network's last layer. What the trainer's entropy
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

/* Activations of hidden layer i (0-based) of the last runs. */
static double most_hidden(const saga_scene *s, const saga_twin *w,
                          const saga_rate_choice *c, int net, int i)
{
    const size_t dim = (size_t)s->net[net].dim[i + 1];
    batches l = { .n = 0 };
    double most = 0;
    size_t k;

    if (saga_is_entropy_net(net))
        l = entropy_batches(c, net);
    else
        add_batch(&l, &w->batch[net], saga_twin_rows(w, net));
    for (k = 0; k < l.n; k++)
        most = fmax(most, most_of(l.b[k]->work.hidden[i], l.rows[k],
                                  saga_dense_pad(dim), 0, dim));
    return most;
}

/* Biases of the entropy networks: as fine as what they give. */
static const float entropy_bias_step = 1.0f / 2048;

static void set_layer_steps(saga_layer_values *v, const saga_rate_choice *c,
                            const saga_weights *steps, int net, int layer)
{
    if (saga_is_entropy_net(net)) {
        v->step = (float)c->rate->plan.step[net];
        v->bias_step = entropy_bias_step;
    } else {
        const int t = saga_weights_find(steps, net, layer);

        v->step = (float)saga_weights_step(steps, t);
        v->bias_step = (float)saga_weights_step(steps, t + 1);
    }
}

/* decoded: NULL, or takes the layers as they were quantised. */
static void pack_net(saga_net_symbols *out, saga_net *decoded,
                     const saga_model *m, const saga_twin *w,
                     const saga_rate_choice *c, int net,
                     const saga_weights *steps)
{
    const saga_scene *const s = &c->scene;
    const saga_net *const f = &s->net[net];
    uint8_t q[SAGA_MAX_VECTOR];
    int q_in = m->q_in[net], i;

    for (i = 0; i < f->n_layers; i++) {
        const uint32_t n_out = (uint32_t)f->dim[i + 1];
        saga_layer_values v = {
            f->w[i], f->b[i], (uint32_t)f->dim[i], n_out, q_in, q, 0, 0,
            m->int8[net]
        };

        set_layer_steps(&v, c, steps, net, i);
        if (i + 1 == f->n_layers)
            output_formats(q, m, net, n_out);
        else
            memset(q, q_for(most_hidden(s, w, c, net, i), 13), n_out);
        saga_quantise_layer(&out->layer[net][i], &v);
        if (decoded)
            saga_dequantise_layer(decoded->w[i], decoded->b[i],
                                  &out->layer[net][i], &v);
        q_in = q[0];
    }
}

/* A network without inputs: its biases are the parameters, row by row. */
static void pack_constants(saga_net_symbols *out, int net,
                           const int32_t *value, uint32_t n)
{
    saga_layer_symbols *const l = &out->layer[net][0];
    uint32_t i;

    l->step_q16 = 1;
    l->bias_scale = 63;
    l->weight = must(calloc(1, sizeof *l->weight));
    l->bias = must(calloc(n, sizeof *l->bias));
    l->shift = must(calloc(n, 1));
    for (i = 0; i < n; i++)
        l->bias[i] = value[i];
}

/* Entropy parameters as constants per channel. */
static void pack_entropy(saga_net_symbols *out, const saga_model *m,
                         const saga_rate_constants *c, int kind)
{
    const uint32_t n = saga_n_channels(m, kind);
    int32_t v[2 * (4 + SAGA_MAX_FEATURES)];
    uint32_t i;

    for (i = 0; i < n; i++) {
        const double mean = (double)c->mean[kind][i];

        v[i] = (int32_t)lrint(ldexp(mean, saga_rate_value_q(m, kind, i)));
        v[n + i] = (int32_t)lrint(ldexp((double)c->log2_sigma[kind][i],
                                        SAGA_COST_SIGMA_Q));
    }
    pack_constants(out, SAGA_NET_E_COARSE + kind, v, 2 * n);
}

/* steps NULL: without the reconstruction networks. */
static void pack_nets(saga_net_symbols *out, saga_scene *decoded,
                      const saga_model *m, const saga_twin *w,
                      const saga_rate_choice *c, const saga_weights *steps)
{
    int net;

    memset(out, 0, sizeof *out);
    for (net = 0; net < SAGA_N_NETS; net++) {
        const int kind = net - SAGA_NET_E_COARSE;

        if (!c->scene.net[net].n_layers ||
            (!steps && !saga_is_entropy_net(net)))
            continue;
        if (kind >= 0 && kind < SAGA_N_KINDS && !m->sources[kind])
            pack_entropy(out, m, &c->rate->constants, kind);
        else
            pack_net(out, decoded ? &decoded->net[net] : NULL, m, w, c, net,
                     steps);
    }
}

void saga_pack_entropy(saga_net_symbols *nets, saga_model *m,
                       const saga_rate_choice *choice, const saga_twin *twin)
{
    entropy_formats(m, choice);
    pack_nets(nets, NULL, m, twin, choice, NULL);
}

/* --- Segment ------------------------------------------------------------- */

static double *to_units(const float *x, size_t n)
{
    double *const u = must(malloc((4 * n + 1) * sizeof *u));
    size_t i;

    for (i = 0; i < 4 * n; i++)
        u[i] = (double)x[i] * (i % 4 < 3 ? 8388608.0 : 65536.0);
    return u;
}

static void alloc_symbols(saga_symbols *y, const saga_scene *s)
{
    const size_t f = s->model.features;
    uint32_t i;

    memset(y, 0, sizeof *y);
    y->n = s->n;
    y->n_nodes = s->n_nodes;
    y->split = s->split;
    y->occupancy = s->occupancy;
    y->n_fine = must(calloc(s->n.coarse + 1u, 1));
    y->centre = must(calloc(s->n.coarse + 1u, 4 * sizeof(int32_t)));
    y->feature = must(calloc(s->n.coarse + 1u, f * sizeof(int32_t)));
    y->fine_suffix = must(calloc(s->n.fine + 1u, sizeof(uint32_t)));
    y->fine_offset = must(calloc(s->n.fine + 1u, 4 * sizeof(int32_t)));
    y->n_prim = must(calloc(s->n.fine + 1u, 1));
    y->prim_suffix = must(calloc(s->n.prim + 1u, sizeof(uint32_t)));
    y->prim_offset = must(calloc(s->n.prim + 1u, 4 * sizeof(int32_t)));
    for (i = 0; i < s->n.coarse; i++)
        y->n_fine[i] = s->coarse[i].n_fine;
    for (i = 0; i < s->n.fine; i++) {
        y->n_prim[i] = s->fine[i].n_prim;
        y->fine_suffix[i] = saga_scene_fine_suffix(s, i);
    }
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

/* (n, 4) units back to half-cubes and segments. */
static void from_units(float *x, const double *u, size_t n)
{
    size_t i;

    for (i = 0; i < 4 * n; i++)
        x[i] = (float)(u[i] / (i % 4 < 3 ? 8388608.0 : 65536.0));
}

/* The same structure; reals to be filled in. */
static int begin_decoded(saga_scene *d, const saga_scene *s,
                         const saga_model *m)
{
    if (saga_scene_init(d, m, s->n, s->n_nodes, 0))
        return 0;
    memcpy(d->split, s->split, s->n_nodes);
    memcpy(d->occupancy, s->occupancy, s->n_nodes * sizeof *s->occupancy);
    memcpy(d->coarse, s->coarse, s->n.coarse * sizeof *s->coarse);
    memcpy(d->fine, s->fine, s->n.fine * sizeof *s->fine);
    memcpy(d->prim_fine, s->prim_fine, s->n.prim * sizeof *s->prim_fine);
    return 1;
}

/* The symbols: y, whose arrays are there. */
static int close_loop(saga_symbols *y, const saga_encoder *e,
                      saga_pack_report *report, saga_scene *decoded,
                      const saga_scene *s, const saga_model *m,
                      const saga_twin *w)
{
    double *const coarse = to_units(s->coarse_x, s->n.coarse);
    double *const fine = to_units(s->fine_x, s->n.fine);
    double *const prim = to_units(s->prim_x, s->n.prim);
    double *const prim_out = must(malloc((4 * (size_t)s->n.prim + 1) *
                                         sizeof *prim_out));
    /* Supports come out of the integer networks a little different. Offsets
     * that were trained to be cheap stay what they are, and positions move by
     * that little: against the positions they would be anywhere again. */
    const saga_targets t = { coarse, s->coarse_feature, fine, prim,
                             w->prim_offset, NULL };
    saga_decoded d = { coarse, fine, prim_out, NULL };
    const saga_nets *nets;
    const uint8_t *params = saga_encoder_params(e, &nets);
    int ok;

    report->order = must(calloc(s->n.prim + 1u, sizeof *report->order));
    d.feature = must(malloc(((size_t)s->n.coarse * m->features + 1) *
                            sizeof *d.feature));
    ok = saga_quantise_segment(y, report->order, &report->quantise, m, nets,
                               params, &t, &d);
    if (ok && decoded) {
        from_units(decoded->coarse_x, coarse, s->n.coarse);
        from_units(decoded->fine_x, fine, s->n.fine);
        from_units(decoded->prim_x, prim_out, s->n.prim);
        memcpy(decoded->coarse_feature, d.feature,
               (size_t)s->n.coarse * m->features * sizeof *d.feature);
    }
    free(d.feature);
    free(prim_out);
    free(coarse);
    free(fine);
    free(prim);
    return ok;
}

int saga_pack(uint8_t **bytes, size_t *n, saga_pack_report *report,
              const saga_rate_choice *choice, saga_twin *twin,
              const float *feature, const saga_header *header,
              const saga_rig_camera *rig, const saga_pack_options *options,
              const char **why)
{
    const saga_scene *const scene = &choice->scene;
    saga_header h = *header;
    saga_scene *const decoded = options->decoded;
    saga_net_symbols nets;
    saga_symbols y;
    saga_encoder *e;
    int ok;

    memset(report, 0, sizeof *report);
    h.model = scene->model;
    measure_formats(&h.model, scene, twin, feature, choice);
    h.level = (uint8_t)options->level;
    h.rate_num = options->rate_num;
    h.rate_den = options->rate_den;
    if (decoded && !begin_decoded(decoded, scene, &h.model)) {
        *why = "out of memory";
        return 0;
    }
    pack_nets(&nets, decoded, &h.model, twin, choice, options->weights);
    e = saga_encoder_open(&h, rig, &nets, why);
    alloc_symbols(&y, scene);
    ok = e != NULL;
    if (ok && !close_loop(&y, e, report, decoded, scene, &h.model, twin)) {
        *why = "the closed loop refused the scene";
        ok = 0;
    }
    ok = ok && saga_encoder_segment(e, &y, options->n_frames, why) &&
         saga_encoder_finish(e, bytes, n, &report->sizes, why);
    saga_encoder_free(e);
    free_symbols(&y);
    saga_net_symbols_free(&nets);
    return ok;
}
