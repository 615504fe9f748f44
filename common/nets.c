/* SPDX-License-Identifier: MIT */
#include "nets.h"

#include "fx.h"
#include "fx_math.h"

/* --- Layout -------------------------------------------------------------- */

static uint32_t layer_weight_nbytes(const saga_net_shape *s, int i)
{
    return saga_mlp_pad(s->dim[i]) * s->dim[i + 1] * (s->int8 ? 1u : 2u);
}

/* Returns the size of a layer: weights, then biases, then shifts, padded to a
 * multiple of 16. */
static uint32_t layer_nbytes(const saga_net_shape *s, int i)
{
    const uint32_t n = layer_weight_nbytes(s, i) + 5u * s->dim[i + 1];

    return (n + 15u) & ~15u;
}

void saga_nets_layout(saga_nets *nets, const saga_model *m)
{
    uint32_t at = 2 * saga_mlp_pad(m->features);
    int net, i;

    for (net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&nets->shape[net], m, net);
        nets->offset[net] = at;
        for (i = 0; i < nets->shape[net].n_layers; i++)
            at += layer_nbytes(&nets->shape[net], i);
    }
    nets->nbytes = at;
}

void saga_nets_offsets(saga_layer_offsets *at, const saga_nets *nets, int net,
                       int i)
{
    const saga_net_shape *const s = &nets->shape[net];
    int k;

    at->weight = nets->offset[net];
    for (k = 0; k < i; k++)
        at->weight += layer_nbytes(s, k);
    at->bias = at->weight + layer_weight_nbytes(s, i);
    at->shift = at->bias + 4u * s->dim[i + 1];
}

void saga_nets_layer(saga_layer *layer, const saga_nets *nets,
                     const uint8_t *block, int net, int i)
{
    const saga_net_shape *const s = &nets->shape[net];
    saga_layer_offsets at;

    saga_nets_offsets(&at, nets, net, i);
    layer->weight = block + at.weight;
    layer->bias = (const int32_t *)(const void *)(block + at.bias);
    layer->shift = block + at.shift;
    layer->n_in = s->dim[i];
    layer->n_out = s->dim[i + 1];
    layer->int8 = s->int8;
    layer->relu = i + 1 < s->n_layers;
    layer->cpu = SAGA_CPU_PLAIN;
}

uint32_t saga_nets_n_finer(const saga_nets *nets, int net, int i)
{
    const saga_net_shape *const s = &nets->shape[net];

    if (net < SAGA_NET_FINE || net > SAGA_NET_COLOUR)
        return 0;
    if (i + 1 < s->n_layers || net == SAGA_NET_COLOUR_BASE)
        return s->dim[i + 1];
    return net == SAGA_NET_FINE ? s->dim[i + 1] - 4u : 0;
}

int saga_nets_takes(const saga_nets *nets, int net)
{
    if (net == SAGA_NET_COLOUR)
        return SAGA_NET_COLOUR_BASE;
    if ((net == SAGA_NET_GEO || net == SAGA_NET_COLOUR_BASE) &&
        nets->shape[SAGA_NET_FUSE_F].n_layers == 0)
        return SAGA_NET_FINE;
    return -1;
}

/* --- Runs ---------------------------------------------------------------- */

static uint32_t longest_vector(const saga_net_shape *s)
{
    uint32_t most = 1;
    int i;

    for (i = 0; i <= s->n_layers; i++)
        most = s->dim[i] > most ? s->dim[i] : most;
    return saga_mlp_pad(most);
}

uint32_t saga_net_points(const saga_nets *nets, uint32_t set)
{
    uint32_t n = SAGA_MAX_POINTS;
    int net;

    for (net = 0; net < SAGA_N_NETS; net++)
        if (set >> net & 1u)
            while (n * longest_vector(&nets->shape[net]) > SAGA_MAX_VECTOR)
                n--;
    return n;
}

/* Layers' outputs alternate between hidden and out, and end in out. */
void saga_net_run(const saga_runner *r, int net, uint32_t n)
{
    saga_vectors *const v = r->v;
    const int16_t *x = v->in;
    saga_layer layer;
    int i;

    (void)saga_tally_add(
        r->tally, n * (saga_net_macs(&r->nets->shape[net]) + SAGA_RUN_WORK));
    for (i = 0; i < r->nets->shape[net].n_layers; i++) {
        int16_t *const y = (r->nets->shape[net].n_layers - i) & 1 ? v->out
                                                                  : v->hidden;

        saga_nets_layer(&layer, r->nets, r->params, net, i);
        layer.cpu = r->cpu;
        saga_mlp_layer(y, &layer, x, n);
        x = y;
    }
}

uint32_t saga_in_point(const saga_runner *r, int net, uint32_t point)
{
    return point * saga_mlp_pad(r->nets->shape[net].dim[0]);
}

const int16_t *saga_out_point(const saga_runner *r, int net, uint32_t point)
{
    const saga_net_shape *const s = &r->nets->shape[net];

    return r->v->out + point * saga_mlp_pad(s->dim[s->n_layers]);
}

/* --- Inputs -------------------------------------------------------------- */

/* Applies fx_requant16 to each value in 32 bits, so that the loop vectorises. A
 * left shift by 15 or more saturates all values except 0; a right shift
 * saturates none. */
static void requant_each(int16_t *restrict to, const int16_t *restrict x,
                         uint32_t n, int left)
{
    const int by = left < 0 ? -left : fx_min(left, 15);
    const int32_t half = 1 << by >> 1;
    uint32_t i;

    if (left == 0)
        for (i = 0; i < n; i++)
            to[i] = (int16_t)fx_max(x[i], -32767);
    else if (left > 0)
        for (i = 0; i < n; i++)
            to[i] = fx_sat16(x[i] * (1 << by));
    else
        for (i = 0; i < n; i++)
            to[i] = (int16_t)((x[i] + half) >> by);
}

uint32_t saga_in_vector(const saga_runner *r, int net, uint32_t at,
                        const int16_t *x, uint32_t n, int q)
{
    requant_each(r->v->in + at, x, n, r->nets->shape[net].q_in - q);
    return at + n;
}

void saga_plain_feature(int16_t *to, const saga_runner *r, const int16_t *x,
                        uint32_t n)
{
    const int16_t *const unit = saga_fine_unit(r->params);
    uint32_t i;

    for (i = 0; i < n; i++)
        to[i] = (int16_t)fx_rshift(x[i] * unit[i], 3);
}

static uint32_t sine_and_cosine(uint16_t *phase, uint32_t at, uint32_t p)
{
    phase[at] = (uint16_t)(p & 65535u);
    phase[at + 1] = (uint16_t)((p + 16384u) & 65535u);
    return at + 2;
}

/* The phases are bits of the position and wrap around; at k = 0, half a cube is
 * a quarter turn. */
void saga_embed(int16_t *q15, const saga_model *m, const int32_t x[3],
                int32_t t, saga_cpu cpu)
{
    uint16_t phase[8 * SAGA_MAX_OCTAVES];
    uint32_t at = 0, k;
    int i;

    for (i = 0; i < 3; i++)
        for (k = 0; k < m->octaves; k++)
            at = sine_and_cosine(phase, at, (uint32_t)(x[i] >> (9 - k)));
    t -= 32768;
    at = sine_and_cosine(phase, at, (uint32_t)(t >> 1));
    for (k = 1; k < m->octaves; k++)
        at = sine_and_cosine(phase, at, (uint32_t)t << (k - 1));
    saga_sin_turn16_each(q15, phase, at, cpu);
}

void saga_embed_offset(int16_t *q15, const saga_model *m,
                       const int16_t offset_q14[4], saga_cpu cpu)
{
    uint16_t phase[8 * SAGA_MAX_OCTAVES];
    uint32_t at = 0, k;
    int i;

    for (i = 0; i < 4; i++)
        for (k = 0; k < m->octaves; k++)
            at = sine_and_cosine(phase, at,
                                 (uint32_t)(int32_t)offset_q14[i] << k);
    saga_sin_turn16_each(q15, phase, at, cpu);
}
