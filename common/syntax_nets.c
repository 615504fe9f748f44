/* SPDX-License-Identifier: MIT */
#include "syntax.h"

#include "fx.h"

/* Residuals of a network are coded in pieces of this number, to limit the
 * stack. */
enum { PIECE = 64 };

typedef struct {
    saga_adaptive shift_high, shift_low[4];
    saga_adaptive finer, scale_mode, drop;
} net_models;

/* A row shift, 0..24, is coded as its eights and its rest. */
static int code_shift(net_models *m, saga_coder *c, saga_at at)
{
    uint32_t high, low;

    high = c->adaptive(c, at, &m->shift_high, 4);
    at.column = 1;
    low = c->adaptive(c, at, &m->shift_low[high], 8);
    return (int)(8 * high + low);
}

typedef struct {
    uint32_t step_q16;
    int step_shift, bias_shift;
    uint8_t weight_scale, bias_scale;
    uint32_t scale_mode;
} layer_fields;

static void code_fields(layer_fields *f, net_models *m, saga_coder *c, int net,
                        int i)
{
    saga_at at = saga_at_symbol(SAGA_SYM_NET_STEP, (uint32_t)net, (uint32_t)i);

    f->step_q16 = c->uniform(c, at, 16);
    at.sym = SAGA_SYM_NET_STEP_SHIFT;
    f->step_shift = (int)c->uniform(c, at, 5);
    at.sym = SAGA_SYM_NET_BIAS_SHIFT;
    f->bias_shift = (int)c->uniform(c, at, 5);
    at.sym = SAGA_SYM_NET_WEIGHT_SCALE;
    f->weight_scale = (uint8_t)c->uniform(c, at, 6);
    at.sym = SAGA_SYM_NET_BIAS_SCALE;
    f->bias_scale = (uint8_t)c->uniform(c, at, 6);
    at.sym = SAGA_SYM_NET_SCALE_MODE;
    f->scale_mode = c->adaptive(c, at, &m->scale_mode, SAGA_N_SCALE_MODES);
}

static void fill(uint8_t *scale, uint32_t n, int value)
{
    uint32_t i;

    for (i = 0; i < n; i++)
        scale[i] = (uint8_t)value;
}

/* Codes the scale of a row or column of n weights. Returns 0 if it would be
 * negative. */
static int code_scale(uint8_t *scale, uint32_t n, const layer_fields *f,
                      net_models *m, saga_coder *c, saga_at at)
{
    int value;

    at.sym = SAGA_SYM_NET_DROP;
    value = f->weight_scale -
            SAGA_DROP * (int)c->adaptive(c, at, &m->drop, SAGA_N_DROPS);
    if (value < 0)
        return 0;
    fill(scale, n, value);
    return 1;
}

/* Codes the scales of the columns, before the rows. */
static int code_columns(uint8_t *scale, uint32_t n_in, const layer_fields *f,
                        net_models *m, saga_coder *c, saga_at at)
{
    uint32_t k;

    fill(scale, n_in, f->weight_scale);
    for (k = 0; f->scale_mode == SAGA_SCALE_COLUMN && k < n_in; k++) {
        at.row = (uint16_t)k;
        if (!code_scale(scale + k, 1, f, m, c, at))
            return 0;
    }
    return 1;
}

/* Values 0..n-1 have formats that are finer by these numbers of bits. */
typedef struct {
    uint8_t by[SAGA_MAX_WIDTH];
    uint32_t n;
} formats;

/* The addresses to which a layer's parameters are written. */
typedef struct {
    uint8_t *weights, *shift;
    int32_t *bias;
    uint32_t n_in, n_out;
    int int8;
    formats in, out; /* formats of its inputs and outputs */
} layer_place;

static void place_layer(layer_place *to, const saga_nets *nets, uint8_t *block,
                        int net, int i)
{
    const saga_net_shape *const s = &nets->shape[net];
    saga_layer_offsets at;

    saga_nets_offsets(&at, nets, net, i);
    to->weights = block + at.weight;
    to->shift = block + at.shift;
    to->bias = (int32_t *)(void *)(block + at.bias);
    to->n_in = s->dim[i];
    to->n_out = s->dim[i + 1];
    to->int8 = s->int8;
    to->out.n = saga_nets_n_finer(nets, net, i);
}

static void store_weight(const layer_place *to, uint32_t row, uint32_t column,
                         int32_t w)
{
    const size_t at = saga_mlp_weight_at(to->n_in, to->n_out, row, column);

    if (to->int8)
        ((int8_t *)to->weights)[at] = (int8_t)w;
    else
        ((int16_t *)(void *)to->weights)[at] = (int16_t)w;
}

/* Codes row at.row of the weights and stores it with its padding. Returns
 * sum|w|, or -1 if a weight is out of range. |q * step| < 2^32. */
static int64_t code_weights(const layer_place *to, const uint8_t *scale,
                            const layer_fields *f, saga_coder *c, saga_at at)
{
    const int32_t limit = to->int8 ? 127 : 32767;
    const uint32_t n_in = to->n_in;
    int32_t q[PIECE];
    int64_t sum = 0;
    uint32_t k, i;

    /* A row is coded in pieces, so that its symbols fit on the stack. */
    for (k = 0; k < n_in; k += PIECE) {
        const uint32_t n = n_in - k < PIECE ? n_in - k : PIECE;

        at.column = (uint16_t)k;
        c->residual(c, at, q, NULL, f->step_q16, scale + k, n);
        for (i = 0; i < n; i++) {
            const int finer = k + i < to->in.n ? to->in.by[k + i] : 0;
            const int64_t w = fx_rshift64((int64_t)q[i] * f->step_q16,
                                          f->step_shift + finer);

            if (w < -limit || w > limit)
                return -1;
            store_weight(to, at.row, k + i, (int32_t)w);
            sum += w < 0 ? -w : w;
        }
    }
    /* The padding lets SIMD read whole vectors. */
    for (k = n_in; k < saga_mlp_pad(n_in); k++)
        store_weight(to, at.row, k, 0);
    return sum;
}

/* Codes row at.row. Returns 0 if the row could overflow. */
static int code_row(layer_place *to, uint8_t *scale, const layer_fields *f,
                    net_models *m, saga_coder *c, saga_at at)
{
    int64_t bias, sum;
    int32_t q;
    int shift;

    /* Formats and scales come before the values that need them. */
    at.sym = SAGA_SYM_NET_ROW_SHIFT;
    shift = code_shift(m, c, at);
    at.sym = SAGA_SYM_NET_FINER;
    if (at.row < to->out.n)
        to->out.by[at.row] = (uint8_t)c->adaptive(c, at, &m->finer,
                                                  SAGA_N_FINER);
    if (f->scale_mode == SAGA_SCALE_ROW &&
        !code_scale(scale, to->n_in, f, m, c, at))
        return 0;
    at.sym = SAGA_SYM_NET_BIAS;
    c->residual(c, at, &q, NULL, 1u << 16, &f->bias_scale, 1);
    bias = (int64_t)q * ((int64_t)1 << f->bias_shift);
    at.sym = SAGA_SYM_NET_WEIGHT;
    sum = code_weights(to, scale, f, c, at);
    if (c->error || sum < 0 || !saga_mlp_row_is_valid(sum, bias, shift))
        return 0;
    to->bias[at.row] = (int32_t)bias;
    to->shift[at.row] = (uint8_t)shift;
    return 1;
}

static int code_layer(layer_place *to, net_models *m, saga_coder *c, int net,
                      int i)
{
    saga_at at = saga_at_symbol(SAGA_SYM_NET_ROW_SHIFT, (uint32_t)net,
                                (uint32_t)i);
    uint8_t scale[SAGA_MAX_VECTOR];
    layer_fields f;
    uint32_t row;

    code_fields(&f, m, c, net, i);
    if (f.step_q16 == 0 || !code_columns(scale, to->n_in, &f, m, c, at))
        return 0;
    for (row = 0; row < to->n_out; row++) {
        at.row = (uint16_t)row;
        if (!code_row(to, scale, &f, m, c, at))
            return 0;
    }
    return 1;
}

/* Stores the units of fine anchors' features at the start of the block, where
 * all readers of the features find them. */
static void store_fine_units(uint8_t *block, const formats *feature)
{
    int16_t *const unit = (int16_t *)(void *)block;
    uint32_t i;

    for (i = 0; i < feature->n; i++)
        unit[i] = (int16_t)(8 >> feature->by[i]);
}

/* Codes a network. `given` holds the formats of the last network whose outputs
 * have their own formats, the only ones that later networks read. */
static int code_network(const saga_nets *nets, uint8_t *block, formats *given,
                        net_models *m, saga_coder *c, int net)
{
    layer_place to;
    int i;

    to.in.n = 0;
    to.out.n = 0;
    if (saga_nets_takes(nets, net) >= 0)
        to.in = *given;
    for (i = 0; i < nets->shape[net].n_layers; i++) {
        place_layer(&to, nets, block, net, i);
        if (!code_layer(&to, m, c, net, i))
            return 0;
        to.in = to.out;
    }
    if (net == SAGA_NET_FINE)
        store_fine_units(block, &to.out);
    if (to.out.n)
        *given = to.out;
    return 1;
}

int saga_syntax_networks(const saga_nets *nets, uint8_t *block, saga_coder *c)
{
    net_models models;
    formats given;
    int net, i;

    saga_adaptive_init(&models.shift_high, 4);
    for (i = 0; i < 4; i++)
        saga_adaptive_init(&models.shift_low[i], 8);
    saga_adaptive_init(&models.finer, SAGA_N_FINER);
    saga_adaptive_init(&models.scale_mode, SAGA_N_SCALE_MODES);
    saga_adaptive_init(&models.drop, SAGA_N_DROPS);
    given.n = 0;
    for (net = 0; net < SAGA_N_NETS; net++)
        if (!code_network(nets, block, &given, &models, c, net))
            return 0;
    return 1;
}
