/* SPDX-License-Identifier: MIT
 *
 * Turns networks into symbols: weights and biases in multiples of their trained
 * steps, a format for each row, and constants for kinds without sources.
 */
#include "pack_state.h"

#include "alloc.h"
#include "cost.h"
#include "fx.h"

#include <math.h>
#include <string.h>

static const char symbols_of_nets[] = "symbols of the networks";

/* Sets the Q format of each row of a network's last layer. Means from the
 * trainer's entropy networks have formats of their own. */
static void output_formats(uint8_t *q, const saga_model *m, int net, uint32_t n)
{
    const int kind = net - SAGA_NET_E_COARSE;
    uint32_t i;

    for (i = 0; i < n; i++)
        q[i] = (uint8_t)(kind >= 0 && kind < SAGA_N_KINDS && i < n / 2
                             ? saga_rate_mu_q(m, kind, i)
                             : saga_output_q(m, net, i));
}

/* Returns how many bits finer than q the values of a row, up to `most`, are
 * coded. That is one bit less than would fit, since a later segment may have
 * larger values. It is 0 if the network that reads them has 8-bit weights,
 * which cannot be shifted down. */
static uint8_t finer_by(const saga_packing *p, int net, double most, int q)
{
    const int reader = net == SAGA_NET_COLOUR_BASE ? SAGA_NET_COLOUR : net;
    const int more = saga_pack_q(2 * p->room * most,
                                 SAGA_EMBEDDING_Q + SAGA_N_FINER - 1) -
                     q;

    return p->model->int8[reader]
               ? 0
               : (uint8_t)fx_clamp(more, 0, SAGA_N_FINER - 1);
}

/* Returns the largest value of row k of layer i. For the first layer of F_color
 * this includes what the direction adds. */
static double most_row(const saga_packing *p, int net, int i, uint32_t k)
{
    const saga_scene *const s = &p->choice->scene;

    if (i + 1 < s->net[net].n_layers)
        return saga_pack_most_hidden(p, net, i, k, 1);
    if (net == SAGA_NET_COLOUR_BASE)
        return saga_pack_most_before_colour(s, p->twin, k, 1);
    return saga_pack_most_out(s, p->twin, net, k, 1);
}

/* Sets the formats of a layer's rows: q of each row, including its bits in
 * `finer` if the row may have any. Returns the format common to the layer,
 * which is q_in of the next one. */
static int row_formats(uint8_t *q, uint8_t *finer, const saga_packing *p,
                       const saga_net_symbols *nets, int net, int i)
{
    const saga_scene *const s = &p->choice->scene;
    const uint32_t n = (uint32_t)s->net[net].dim[i + 1];
    int common;
    uint32_t k;

    /* First comes the format common to the layer: for the last layer the
     * output's, for a hidden layer that of its largest unit. */
    if (i + 1 == s->net[net].n_layers)
        output_formats(q, p->model, net, n);
    else
        memset(q,
               saga_pack_q(p->room * saga_pack_most_hidden(p, net, i, 0, n),
                           SAGA_EMBEDDING_Q),
               n);
    common = q[0];
    /* Then rows with small values get additional bits. */
    for (k = 0; k < saga_nets_n_finer(p->shapes, net, i); k++) {
        finer[k] = finer_by(p, net, most_row(p, net, i, k), common);
        q[k] = (uint8_t)(common + finer[k]);
    }
    /* The part of F_color's first layer that reads the direction is added to
     * the part that reads the features, and must have the formats of that
     * part. */
    for (k = 0; net == SAGA_NET_COLOUR_VIEW && k < n; k++)
        q[k] = (uint8_t)(common +
                         nets->layer[SAGA_NET_COLOUR_BASE][0].finer[k]);
    /* So must the corrections of that part, the last rows of D_res. */
    if (net == SAGA_NET_RES && i == 1)
        for (k = 0; k < p->model->width[SAGA_NET_COLOUR]; k++)
            q[n - p->model->width[SAGA_NET_COLOUR] + k] +=
                nets->layer[SAGA_NET_COLOUR_BASE][0].finer[k];
    return common;
}

/* Sets the formats of a layer's inputs, which are the rows of the previous
 * layer. */
static void input_formats(saga_layer_values *v, const saga_net_symbols *nets,
                          const saga_packing *p, int net, int i)
{
    /* A first layer may read another network's rows directly. Then the previous
     * layer is the last one of that network. */
    if (i == 0 && saga_nets_takes(p->shapes, net) >= 0) {
        net = saga_nets_takes(p->shapes, net);
        i = p->shapes->shape[net].n_layers;
    }
    v->n_finer = i ? saga_nets_n_finer(p->shapes, net, i - 1) : 0;
    v->finer = i ? nets->layer[net][i - 1].finer : NULL;
}

/* The step of the entropy networks' biases, the precision of their outputs. */
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

static bool pack_layer(saga_net_symbols *out, int *q_in, const saga_packing *p,
                       int net, int i, saga_error *error)
{
    const saga_net *const f = &p->choice->scene.net[net];
    const uint32_t n_out = (uint32_t)f->dim[i + 1];
    saga_layer_symbols *const l = &out->layer[net][i];
    uint8_t q[SAGA_MAX_VECTOR];
    saga_layer_values v = {
        f->w[i], f->b[i], (uint32_t)f->dim[i], n_out, *q_in, q, NULL, 0,
        0,       0,       p->model->int8[net], net,   i
    };

    l->finer = saga_calloc(n_out, 1, symbols_of_nets, error);
    if (!l->finer)
        return false;
    /* Outputs come before inputs: row_formats sets q_in for the next layer,
     * after v has copied the present one. */
    *q_in = row_formats(q, l->finer, p, out, net, i);
    input_formats(&v, out, p, net, i);
    set_layer_steps(&v, p->choice, p->steps, net, i);
    if (!saga_quantise_layer(l, &v, error))
        return false;
    /* The decoded values are kept for the decoded scene and for later
     * segments. */
    if (p->decoded)
        saga_dequantise_layer(p->decoded->net[net].w[i],
                              p->decoded->net[net].b[i], l, &v);
    return true;
}

static bool pack_net(saga_net_symbols *out, const saga_packing *p, int net,
                     saga_error *error)
{
    int q_in = p->model->q_in[net], i;

    for (i = 0; i < p->choice->scene.net[net].n_layers; i++)
        if (!pack_layer(out, &q_in, p, net, i, error))
            return false;
    return true;
}

/* Packs a network without inputs, whose only parameters are its biases, one for
 * each row. */
static bool pack_constants(saga_net_symbols *out, int net, const int32_t *value,
                           uint32_t n, saga_error *error)
{
    saga_layer_symbols *const l = &out->layer[net][0];

    /* Constants may be large, so they are coded with the widest deviation. */
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

/* Packs the constants of a kind without sources, two for each channel. */
static bool pack_entropy(saga_net_symbols *out, const saga_packing *p, int kind,
                         saga_error *error)
{
    const saga_rate_constants *const c = &p->choice->rate->constants;
    const uint32_t n = saga_n_channels(p->model, kind);
    int32_t v[2 * (4 + SAGA_MAX_FEATURES)];
    uint32_t i;

    for (i = 0; i < n; i++) {
        const double mean = (double)c->mean[kind][i];

        /* They are ordered as a network's rows: first the means in the values'
         * formats, then log2 of the deviations. */
        v[i] = (int32_t)lrint(
            ldexp(mean, saga_rate_value_q(p->model, kind, i)));
        v[n + i] = (int32_t)lrint(
            ldexp((double)c->log2_sigma[kind][i], SAGA_COST_SIGMA_Q));
    }
    return pack_constants(out, SAGA_NET_E_COARSE + kind, v, 2 * n, error);
}

bool saga_pack_nets(saga_net_symbols *out, const saga_packing *p,
                    saga_error *error)
{
    bool ok = true;
    int net;

    memset(out, 0, sizeof *out);
    for (net = 0; net < SAGA_N_NETS && ok; net++) {
        const int kind = net - SAGA_NET_E_COARSE;

        /* Skips absent networks and, without steps, all except the entropy
         * model's. */
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
    const saga_packing p = { m, choice, twin, NULL, NULL, &shapes, 1 };

    saga_nets_layout(&shapes, m);
    saga_pack_entropy_formats(m, choice);
    return saga_pack_nets(nets, &p, error);
}
