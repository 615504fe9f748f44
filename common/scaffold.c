/* SPDX-License-Identifier: MIT */
#include "scaffold.h"

#include "fx.h"
#include "fx_math.h"
#include "interp.h"

/* --- Networks in memory -------------------------------------------------- */

static uint32_t layer_weight_nbytes(const saga_net_shape *s, int i)
{
    return saga_mlp_pad(s->dim[i]) * s->dim[i + 1] * (s->int8 ? 1u : 2u);
}

/* Weights, biases, shifts; each layer starts at a multiple of 16. */
static uint32_t layer_nbytes(const saga_net_shape *s, int i)
{
    const uint32_t n = layer_weight_nbytes(s, i) + 5u * s->dim[i + 1];

    return (n + 15u) & ~15u;
}

void saga_nets_layout(saga_nets *nets, const saga_model *m)
{
    uint32_t at = 0;
    int net, i;

    for (net = 0; net < SAGA_N_NETS; net++) {
        saga_model_net(&nets->shape[net], m, net);
        nets->offset[net] = at;
        for (i = 0; i < nets->shape[net].n_layers; i++)
            at += layer_nbytes(&nets->shape[net], i);
    }
    nets->nbytes = at;
}

void saga_nets_place(saga_layer_place *at, const saga_nets *nets, int net,
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
    saga_layer_place at;

    saga_nets_place(&at, nets, net, i);
    layer->weight = block + at.weight;
    layer->bias = (const int32_t *)(const void *)(block + at.bias);
    layer->shift = block + at.shift;
    layer->n_in = s->dim[i];
    layer->n_out = s->dim[i + 1];
    layer->int8 = s->int8;
    layer->relu = i + 1 < s->n_layers;
}

void saga_memory_size(saga_memory *memory, const saga_model *m)
{
    memory->n_slots = m->memory_slots;
    memory->width = m->memory_width;
    memory->hidden = m->width[SAGA_NET_WRITE];
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
void saga_net_run(const saga_scaffold *sc, int net, uint32_t n)
{
    saga_vectors *const v = sc->v;
    const int16_t *x = v->in;
    saga_layer layer;
    int i;

    for (i = 0; i < sc->nets->shape[net].n_layers; i++) {
        int16_t *const y = (sc->nets->shape[net].n_layers - i) & 1
                               ? v->out : v->hidden;

        saga_nets_layer(&layer, sc->nets, sc->params, net, i);
        saga_mlp_layer(y, &layer, x, n);
        x = y;
    }
}

/* --- Input vectors ------------------------------------------------------- */

uint32_t saga_in_point(const saga_scaffold *sc, int net, uint32_t point)
{
    return point * saga_mlp_pad(sc->nets->shape[net].dim[0]);
}

const int16_t *saga_out_point(const saga_scaffold *sc, int net,
                              uint32_t point)
{
    const saga_net_shape *const s = &sc->nets->shape[net];

    return sc->v->out + point * saga_mlp_pad(s->dim[s->n_layers]);
}

uint32_t saga_in_vector(const saga_scaffold *sc, int net, uint32_t at,
                        const int16_t *x, uint32_t n, int q)
{
    const int q_in = sc->model->q_in[net];
    uint32_t i;

    for (i = 0; i < n; i++)
        sc->v->in[at + i] = fx_requant16(x[i], q, q_in);
    return at + n;
}

uint32_t saga_in_embedding(const saga_scaffold *sc, int net, uint32_t at,
                           const int16_t *q15)
{
    return saga_in_vector(sc, net, at, q15, saga_pe_size(sc->model), 15);
}

/* --- Embeddings ---------------------------------------------------------- */

static uint32_t sine_and_cosine(uint16_t *phase, uint32_t at, uint32_t p)
{
    phase[at] = (uint16_t)(p & 65535u);
    phase[at + 1] = (uint16_t)((p + 16384u) & 65535u);
    return at + 2;
}

/* Phases from the position's own bits, wrapping: a quarter turn per half-cube
 * at k = 0. */
void saga_embed(int16_t *q15, const saga_model *m, const int32_t x[3],
                int32_t t)
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
    saga_sin_turn16_each(q15, phase, at);
}

void saga_embed_offset(int16_t *q15, const saga_model *m,
                       const int16_t offset_q14[4])
{
    uint16_t phase[8 * SAGA_MAX_OCTAVES];
    uint32_t at = 0, k;
    int i;

    for (i = 0; i < 4; i++)
        for (k = 0; k < m->octaves; k++)
            at = sine_and_cosine(phase, at,
                                 (uint32_t)(int32_t)offset_q14[i] << k);
    saga_sin_turn16_each(q15, phase, at);
}

/* --- Places -------------------------------------------------------------- */

void saga_place_cell(saga_place *p, const saga_coarse *c)
{
    const int log2_x = SAGA_LOG2_HALF_X - c->depth_x;
    const int log2_t = SAGA_LOG2_HALF_T - c->depth_t;
    int i;

    for (i = 0; i < 3; i++) {
        p->x[i] = SAGA_X_MIN + (2 * (int32_t)c->cell[i] + 1) * (1 << log2_x);
        p->support[i] = 1 << log2_x;
        p->log2_support_q10[i] = log2_x * 1024;
    }
    p->t = (2 * (int32_t)c->cell_t + 1) * (1 << log2_t);
    p->support[3] = 1 << log2_t;
    p->log2_support_q10[3] = log2_t * 1024;
}

/* |support * offset| <= 2^23 * 2^15. */
void saga_place_move(saga_place *p, const int16_t offset_q14[4])
{
    int i;

    for (i = 0; i < 3; i++)
        p->x[i] = fx_clamp64(p->x[i] + fx_rshift64((int64_t)p->support[i] *
                                                   offset_q14[i], 14),
                             SAGA_X_MIN, SAGA_X_MAX);
    p->t = fx_clamp64(p->t + fx_rshift64((int64_t)p->support[3] *
                                         offset_q14[3], 14), 0, SAGA_T_MAX);
}

void saga_place_fine(saga_place *p, const saga_fine *f)
{
    int i;

    for (i = 0; i < 3; i++)
        p->x[i] = f->x[i];
    p->t = f->t;
    for (i = 0; i < 4; i++) {
        p->support[i] = f->support[i];
        p->log2_support_q10[i] = f->local[i];
    }
}

/* --- Coarse to fine ------------------------------------------------------ */

/* Interpolated, fused features at p: F of them, in saga_fused_q. */
static void fuse(int16_t *feature, const saga_scaffold *sc, int level,
                 const saga_place *p, uint32_t parent)
{
    const uint32_t f = sc->model->features;
    const int net = saga_fuse_net(level);
    int16_t embedding[8 * SAGA_MAX_OCTAVES];
    saga_neighbours nb;
    uint32_t at, i;

    saga_interp_find(&nb, sc, level, p, parent, SAGA_ALL_GROUPS);
    saga_interp_sum(feature, sc, level, &nb);
    if (sc->nets->shape[net].n_layers == 0)
        return;
    at = saga_in_vector(sc, net, 0, feature, f,
                        saga_feature_q(sc->model, level));
    saga_embed(embedding, sc->model, p->x, p->t);
    saga_in_embedding(sc, net, at, embedding);
    saga_net_run(sc, net, 1);
    for (i = 0; i < f; i++)
        feature[i] = sc->v->out[i];
}

/* The values of a point: no more than the input of a network that reads them.
 */
static int16_t *kept_local(const saga_scaffold *sc, uint32_t point)
{
    return sc->v->kept + point * (sc->model->features +
                                  saga_pe_size(sc->model));
}

void saga_keep_local(const saga_scaffold *sc, int level, uint32_t point,
                     const saga_place *p, uint32_t parent,
                     const int16_t offset_q14[4])
{
    int16_t *const to = kept_local(sc, point);

    fuse(to, sc, level, p, parent);
    saga_embed_offset(to + sc->model->features, sc->model, offset_q14);
}

void saga_in_local(const saga_scaffold *sc, int net, int level, uint32_t n)
{
    const uint32_t f = sc->model->features;
    uint32_t i;

    for (i = 0; i < n; i++) {
        const int16_t *const from = kept_local(sc, i);
        const uint32_t at = saga_in_vector(sc, net, saga_in_point(sc, net, i),
                                           from, f,
                                           saga_fused_q(sc->model, level));

        saga_in_embedding(sc, net, at, from + f);
    }
}

/* 2^log2 rounded to an integer in 1..2^max; |log2_q10| < 2^15. */
static int32_t support_from_log2(int32_t log2_q10, int max)
{
    const int32_t x = fx_clamp(log2_q10, 0, max * 1024);
    const uint32_t m = saga_exp2_frac_q16_q30((uint32_t)(x & 1023) << 6);

    return (int32_t)fx_rshift64((int64_t)m, 30 - (int)(x >> 10));
}

/* Log supports leave the network relative to the parent's half-sizes. They are
 * kept clamped, so that every later use sees the support that is. */
static void set_support(saga_fine *f, const saga_coarse *parent,
                        const int16_t out[4], int q)
{
    int i;

    for (i = 0; i < 4; i++) {
        const int max = i < 3 ? SAGA_LOG2_HALF_X : SAGA_LOG2_HALF_T + 1;
        const int half = i < 3 ? SAGA_LOG2_HALF_X - parent->depth_x
                               : SAGA_LOG2_HALF_T - parent->depth_t;
        const int32_t log2_q10 = fx_clamp(
            half * 1024 + fx_requant32(out[i], q, 10), 0, max * 1024);

        f->local[i] = (int16_t)log2_q10;
        f->support[i] = support_from_log2(log2_q10, max);
    }
}

/* Here the supports are still the parent's half-sizes. */
static void keep_fine_anchor(const saga_scaffold *sc, uint32_t rank,
                             uint32_t point)
{
    const saga_fine *const fine = &sc->fine[rank];
    saga_place p;

    saga_place_fine(&p, fine);
    saga_keep_local(sc, SAGA_LEVEL_COARSE, point, &p, fine->parent,
                    fine->local);
}

static void set_fine_anchor(const saga_scaffold *sc, uint32_t rank,
                            const int16_t *out)
{
    const uint32_t f = sc->model->features;
    int16_t *const feature = sc->fine_feature + (size_t)rank * f;
    saga_fine *const fine = &sc->fine[rank];
    uint32_t i;

    for (i = 0; i < f; i++)
        feature[i] = out[i];
    set_support(fine, &sc->coarse[fine->parent], out + f,
                sc->model->head_q[SAGA_HEAD_SUPPORT]);
}

void saga_scaffold_fine(const saga_scaffold *sc)
{
    const uint32_t most = saga_net_points(sc->nets, 1u << SAGA_NET_FINE);
    uint32_t rank, n, i;

    for (rank = 0; rank < sc->n.fine; rank += n) {
        n = sc->n.fine - rank < most ? sc->n.fine - rank : most;
        for (i = 0; i < n; i++)
            keep_fine_anchor(sc, rank + i, i);
        saga_in_local(sc, SAGA_NET_FINE, SAGA_LEVEL_COARSE, n);
        saga_net_run(sc, SAGA_NET_FINE, n);
        for (i = 0; i < n; i++)
            set_fine_anchor(sc, rank + i,
                            saga_out_point(sc, SAGA_NET_FINE, i));
    }
}
